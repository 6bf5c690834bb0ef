"""Crossover of sequences: allowed, no dearer than any, and the best choice there is."""

from __future__ import annotations

from dataclasses import replace
from functools import reduce

import numpy as np
import pytest

from decmcts.search.decomposition.blocks import Sequence, crossover
from decmcts.search.sequence.metric_kernels import respects
from tests.search.problems import found, varied

CASES = [0, 1, 2, 3, 4, 5]  # points, loops, seconds, twice; see `varied`


def best_of_all_choices(sequences: list[Sequence]) -> float:
    """The least cost over all choices of windows, by trying every one."""
    n, following = len(sequences[0].order), range(len(sequences))
    visits = [[(c, s.reversed[c], s.entry_id[c]) for c in s.order.tolist()] for s in sequences]
    begun = {(): set(following)}  # what may be printed so far: whom to follow from there
    for k in range(n):
        longer: dict[tuple, set[int]] = {}
        made = [frozenset(s.order[: k + 1].tolist()) for s in sequences]
        for printed, able in begun.items():
            for s in able:
                others = (t for t in following if made[t] == made[s])
                longer.setdefault((*printed, visits[s][k]), set()).update(others)
        begun = longer
    least = np.inf
    for printed in begun:
        tried = sequences[0].copy()
        order, is_reversed, entry_id = (np.array(column) for column in zip(*printed, strict=True))
        tried.order[:] = order
        tried.reversed[order], tried.entry_id[order] = is_reversed, entry_id
        least = min(least, tried.cost)
    return float(least)


def mutated(sequence: Sequence, seed: int, swaps: int) -> Sequence:
    """The sequence with some neighbours swapped that may be, and a contour or two entered anew."""
    random, child = np.random.default_rng(seed), sequence.copy()
    graph = sequence.problem.graph
    for k in random.choice(len(child.order) - 1, swaps, replace=False):
        child.order[k : k + 2] = child.order[k : k + 2][::-1]
        if not respects(child.order, graph.succ_offsets, graph.succs):
            child.order[k : k + 2] = child.order[k : k + 2][::-1]
    problem = child.problem
    if problem.reversible.any():
        child.reversed[random.choice(np.flatnonzero(problem.reversible))] ^= 1
    if problem.seams is not None:
        c = random.choice(np.flatnonzero(child.entry_id >= 0))
        child.entry_id[c] = random.integers(problem.seams.offsets[c], problem.seams.offsets[c + 1])
    return child


@pytest.mark.slow
@pytest.mark.parametrize(("count", "swaps"), [(2, 4), (3, 2), (4, 1)])
@pytest.mark.parametrize("seed", CASES)
def test_the_best_choice_of_segments_is_taken(seed: int, count: int, swaps: int) -> None:
    """Against all choices, on sequences that differ in a few places."""
    start = found(varied(seed), seed, iterations=10)
    given = [mutated(start, seed + 100 * k, swaps) for k in range(count)]
    child, graph = crossover(given), start.problem.graph
    assert child.cost == pytest.approx(best_of_all_choices(given), rel=1e-12)
    assert respects(child.order, graph.succ_offsets, graph.succs)


@pytest.mark.parametrize("seed", CASES)
def test_what_annealing_made_twice_is_joined(seed: int) -> None:
    """Of two unlike sequences of one print comes one that is no dearer than either."""
    problem = varied(seed)
    one, other = (found(problem, k, iterations=2000) for k in (seed, seed + 50))
    child = crossover([one, other])
    assert child.cost <= min(one.cost, other.cost) * (1 + 1e-12)
    assert respects(child.order, problem.graph.succ_offsets, problem.graph.succs)
    assert not (child.reversed & ~problem.reversible).any()


def test_several_sequences_are_joined_better_than_two_at_a_time() -> None:
    """What of one is dropped for the next would have gone well with the one after it."""
    start = found(varied(0), 0, iterations=10)
    better = 0
    for seed in range(0, 1000, 100):
        given = [start.copy() for _ in range(5)]
        for again in range(8):
            given = [mutated(one, seed + 10 * k + again, 2) for k, one in enumerate(given)]
        in_turn = reduce(lambda one, other: crossover([one, other]), given)
        child = crossover(given)
        assert child.cost <= in_turn.cost * (1 + 1e-12)
        better += child.cost < in_turn.cost * (1 - 1e-9)
    assert better > 0


def test_on_ties_the_first_is_followed() -> None:
    """Else equal seeds might end in unlike sequences of equal cost."""
    problem = replace(varied(3), start=np.zeros((60, 3)), end=np.zeros((60, 3)))
    one = found(problem, 1, iterations=10)
    other = mutated(one, 2, 6)
    assert (one.order != other.order).any()
    for given in ([one, other], [other, one, other]):
        assert (crossover(given).order == given[0].order).all()


@pytest.mark.parametrize("count", [1, 3])
def test_joining_leaves_what_is_joined_as_it_was(count: int) -> None:
    """Threads go on with the sequences they have."""
    given = [found(varied(1), k, iterations=1000) for k in range(count)]
    before = [sequence.copy() for sequence in given]
    assert crossover(given).cost <= min(sequence.cost for sequence in before) * (1 + 1e-12)
    for sequence, was in zip(given, before, strict=True):
        assert (sequence.order == was.order).all()
        assert (sequence.reversed == was.reversed).all()
        assert (sequence.entry_id == was.entry_id).all()
