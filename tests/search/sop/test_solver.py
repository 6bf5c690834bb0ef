"""The bare sequential ordering problem: optimal where it says so, repeatable, fussy on input."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decmcts.errors import InputError
from decmcts.search.sequence.stopping import Stopping
from decmcts.search.sop.assignment import AssignmentTree, assign, patch_cycles
from decmcts.search.sop.beam import Beam
from decmcts.search.sop.precedence import Precedence
from decmcts.search.sop.solver import search_sop


def random_sop(
    seed: int, n: int, density: float, *, fractions: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Costs with ties and zeros, and precedence in a shuffled numbering."""
    rng = np.random.default_rng(seed)
    costs = rng.integers(0, 8, (n, n)).astype(np.float64)
    if fractions:
        costs = rng.random((n, n)) ** 3
    pairs = np.argwhere(np.triu(rng.random((n, n)) < density, 1))
    return costs, rng.permutation(n).astype(np.int32)[pairs].reshape(-1, 2)


def ended(seed: int, n: int, density: float) -> tuple[Precedence, np.ndarray]:
    """Return a problem whose node 0 is first and n - 1 last, and its costs."""
    costs, pairs = random_sop(seed, n, density)
    ends = [(0, k) for k in range(1, n)] + [(k, n - 1) for k in range(n - 1)]
    forward = [(a, b) for a, b in np.sort(pairs, axis=1) if a < b]
    precedence = Precedence.of(n, np.array(forward + ends, np.int32))
    costs = costs[np.ix_(precedence.original, precedence.original)]
    np.fill_diagonal(costs, 0.0)
    return precedence, costs


def respects_pairs(order: np.ndarray, pairs: np.ndarray) -> bool:
    """Say whether a sequence of all nodes keeps the precedence."""
    place = np.argsort(order)
    return bool((place[pairs[:, 0]] < place[pairs[:, 1]]).all()) and len(order) == place.max() + 1


def cheapest(costs: np.ndarray, pairs: np.ndarray) -> float:
    """Return the optimum by trying every sequence."""
    best = np.inf
    for order in itertools.permutations(range(len(costs))):
        place = np.argsort(order)
        if all(place[a] < place[b] for a, b in pairs):
            best = min(best, sum(costs[a, b] for a, b in itertools.pairwise(order)))
    return float(best)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 7),
    density=st.sampled_from([0.0, 0.2, 0.6]),
    fractions=st.booleans(),
)
def test_small_instances_are_solved_and_proven(
    seed: int, n: int, density: float, fractions: bool
) -> None:
    """Beam search that drops nothing is exact; a wrong proof is worse than none."""
    costs, pairs = random_sop(seed, n, density, fractions=fractions)
    found = search_sop(costs, pairs, stopping=Stopping(60.0), seed=seed % 100)
    place = np.argsort(found.order)
    assert sorted(found.order) == list(range(n))
    assert all(place[a] < place[b] for a, b in pairs)
    assert found.cost == pytest.approx(costs[found.order[:-1], found.order[1:]].sum())
    assert found.cost == pytest.approx(cheapest(costs, pairs))
    assert found.optimal


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(2, 7), density=st.sampled_from([0.0, 0.3]))
def test_the_assignment_bounds_and_prices_every_sequence(seed: int, n: int, density: float) -> None:
    """The beam prunes by it, and the result's bound is it: it must hold to the last unit."""
    precedence, costs = ended(seed, n, density)
    assignment = assign(costs, precedence.possible)
    assert (assignment.reduced >= 0.0).all()
    for middle in itertools.permutations(range(1, n - 1)):
        order = np.array([0, *middle, n - 1])
        if respects_pairs(order, precedence.pairs):
            real = costs[order[:-1], order[1:]].sum()
            reduced = assignment.reduced[order[:-1], order[1:]].sum()
            assert real == pytest.approx(assignment.bound + reduced)
    steps = np.where(precedence.possible, costs, np.inf)
    order = patch_cycles(steps, assignment.following)
    assert sorted(order) == list(range(n))
    assert (order[0], order[-1]) == (0, n - 1)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 12))
def test_closure_and_reduction_are_those_of_the_definition(seed: int, n: int) -> None:
    """A missing edge breaks the order, a needless one slows every move."""
    _, pairs = random_sop(seed, n, 0.3)
    precedence = Precedence.of(n, pairs)
    reach = np.zeros((n, n), np.bool_)
    reach[pairs[:, 0], pairs[:, 1]] = True
    for k in range(n):
        reach |= reach[:, [k]] & reach[[k], :]
    numbers = precedence.original
    before = reach[np.ix_(numbers, numbers)]
    assert (precedence.before == before).all()
    assert not np.tril(before).any()
    through = (before.astype(int) @ before.astype(int)) > 0
    assert (precedence.direct == (before & ~through)).all()


@pytest.mark.parametrize("backward", [False, True])
def test_a_narrow_beam_is_feasible_and_a_wide_one_exact(backward: bool) -> None:
    """From both ends, and in small steps, the beam must come to the same optimum."""
    precedence, costs = ended(11, 12, 0.25)
    beam = Beam(costs, precedence, seed=3, backward=backward)
    bests = []
    while not beam.exhausted:
        beam.step(7, np.inf)
        if beam.found is not None:
            assert respects_pairs(beam.found, precedence.pairs)
            assert beam.found_cost == costs[beam.found[:-1], beam.found[1:]].sum()
            bests.append(beam.found_cost)
    assert beam.width > 8
    assert bests[-1] == min(bests)
    exact = search_sop(costs, precedence.pairs, stopping=Stopping(60.0))
    assert exact.optimal
    assert bests[-1] == exact.cost


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1), n=st.integers(2, 7), density=st.sampled_from([0.0, 0.1, 0.4])
)
def test_branch_and_bound_alone_is_exact(seed: int, n: int, density: float) -> None:
    """Its bound ends searches: a branch cut off wrongly would be a wrong proof."""
    precedence, costs = ended(seed, n, density)
    assignment = assign(costs, precedence.possible)
    table = np.where(precedence.possible, assignment.reduced, np.inf)
    tree, best = AssignmentTree(table, precedence), np.inf
    optimum = cheapest(costs, precedence.pairs)
    for _ in range(1000):
        assert min(assignment.bound + tree.bound, best) <= optimum + 1e-9
        relaxed = tree.step(best - assignment.bound - 0.5)
        if relaxed is None:
            break
        order = precedence.repaired(relaxed)
        assert respects_pairs(order, precedence.pairs)
        best = min(best, costs[order[:-1], order[1:]].sum())
    assert tree.exhausted
    assert best == optimum


@pytest.mark.slow
def test_equal_seeds_and_iterations_give_equal_results() -> None:
    """Threads must not decide what is found."""
    rng = np.random.default_rng(5)
    costs = rng.integers(1, 1000, (60, 60)).astype(np.float64)
    pairs = np.array([(a, a + 20) for a in range(0, 40, 3)], np.int32)
    first, second = (
        search_sop(costs, pairs, stopping=Stopping(iterations=200_000), seed=2) for _ in range(2)
    )
    assert (first.order == second.order).all()
    assert first.iterations == second.iterations
    assert (first.history[:, 1:] == second.history[:, 1:]).all()
    assert first.bound <= first.cost


def test_a_stop_wish_ends_the_search_at_once() -> None:
    """Ctrl-C keeps what there is."""
    costs, _ = random_sop(1, 40, 0.0)
    found = search_sop(
        costs, np.empty((0, 2), np.int32), stopping=Stopping(600.0, asked=lambda: True)
    )
    assert sorted(found.order) == list(range(40))


def test_a_cycle_is_named() -> None:
    """The user counts from 1 as the file does, and needs the culprits only."""
    pairs = np.array([(0, 1), (1, 2), (2, 3), (3, 1), (3, 4)], np.int32)
    with pytest.raises(InputError, match="cycle") as caught:
        search_sop(np.zeros((5, 5)), pairs, stopping=Stopping(1.0))
    assert "2 → 3 → 4 → 2" in str(caught.value)


@pytest.mark.parametrize(
    ("costs", "pairs", "word"),
    [
        (np.zeros((2, 3)), [], "shape"),
        (np.full((2, 2), -1.0), [], "below 0"),
        (np.full((2, 2), np.nan), [], "not a number"),
        (np.full((2, 2), 1e13), [], "above 1e"),
        (np.zeros((2, 2)), [(0, 2**32)], "outside"),
        (np.zeros((2, 2)), [(0.0, 1.0)], "whole numbers"),
        (np.zeros((2, 2)), [(0, 2)], "outside"),
        (np.zeros((3, 3)), [(0, 0, 1), (1, 2, 2)], "precedence has shape"),
    ],
)
def test_unusable_arguments_are_refused(costs: np.ndarray, pairs: list, word: str) -> None:
    """A public function says what is wrong before it computes nonsense."""
    with pytest.raises(InputError, match=word):
        search_sop(costs, np.array(pairs), stopping=Stopping(1.0))
