"""Crossover of two sequences: allowed, no dearer than either, and the best choice there is."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from decmcts._kernels.tour import respects
from decmcts.search.crossover import crossover, joined
from decmcts.search.pieces import Sequence
from tests.search.test_fusing import found, varied

CASES = [0, 1, 2, 3, 4, 5, 6, 7]  # points, loops, seconds, bare costs, twice; see `varied`


def best_of_all_choices(one: Sequence, other: Sequence) -> float:
    """The least cost over all choices of stretches, by trying every one."""
    n = len(one.order)
    ends = [k for k in range(1, n + 1) if set(one.order[:k]) == set(other.order[:k])]
    stretches = list(itertools.pairwise([0, *ends]))
    alike = [
        (one.order[a:b] == other.order[a:b]).all()
        and (one.flip[one.order[a:b]] == other.flip[one.order[a:b]]).all()
        and (one.seat[one.order[a:b]] == other.seat[one.order[a:b]]).all()
        for a, b in stretches
    ]
    least = np.inf
    for choice in itertools.product(*[(0,) if same else (0, 1) for same in alike]):
        tried = one.copy()
        for (a, b), taken in zip(stretches, choice, strict=True):
            ids = (one, other)[taken].order[a:b]
            tried.order[a:b] = ids
            tried.flip[ids] = (one, other)[taken].flip[ids]
            tried.seat[ids] = (one, other)[taken].seat[ids]
        least = min(least, tried.cost)
    return float(least)


def mutated(sequence: Sequence, seed: int, swaps: int) -> Sequence:
    """The sequence with some neighbours that may be swapped, swapped."""
    random, child = np.random.default_rng(seed), sequence.copy()
    graph = sequence.problem.graph
    for k in random.choice(len(child.order) - 1, swaps, replace=False):
        child.order[k : k + 2] = child.order[k : k + 2][::-1]
        if not respects(child.order, graph.succ_offsets, graph.succs):
            child.order[k : k + 2] = child.order[k : k + 2][::-1]
    return child


@pytest.mark.parametrize("seed", CASES)
def test_the_best_choice_of_stretches_is_taken(seed: int) -> None:
    """Against all choices, on sequences that differ in a few places."""
    start = found(varied(seed), seed, iterations=10)
    one, other = mutated(start, seed, 4), mutated(start, seed + 100, 4)
    child, graph = crossover(one, other), one.problem.graph
    assert child.cost == pytest.approx(best_of_all_choices(one, other), rel=1e-12)
    assert respects(child.order, graph.succ_offsets, graph.succs)


@pytest.mark.parametrize("seed", CASES)
def test_what_annealing_made_twice_is_joined(seed: int) -> None:
    """Of two unlike sequences of one print comes one that is no dearer than either."""
    problem = varied(seed)
    one, other = (found(problem, k, iterations=2000) for k in (seed, seed + 50))
    child = crossover(one, other)
    assert child.cost <= min(one.cost, other.cost) * (1 + 1e-12)
    assert respects(child.order, problem.graph.succ_offsets, problem.graph.succs)
    assert not (child.flip & ~problem.reversible).any()


def test_a_sequence_with_itself_stays() -> None:
    """On ties nothing changes."""
    one = found(varied(1), 1, iterations=100)
    child = crossover(one, one)
    assert (child.order == one.order).all()
    assert (child.flip == one.flip).all()


@pytest.mark.parametrize("count", [1, 3])
def test_joining_leaves_what_is_joined_as_it_was(count: int) -> None:
    """Races go on with the sequences they have."""
    given = [found(varied(1), k, iterations=1000) for k in range(count)]
    before = [sequence.copy() for sequence in given]
    assert joined(given).cost <= min(sequence.cost for sequence in before) * (1 + 1e-12)
    for sequence, was in zip(given, before, strict=True):
        assert (sequence.order == was.order).all()
        assert (sequence.flip == was.flip).all()
        assert (sequence.seat == was.seat).all()
