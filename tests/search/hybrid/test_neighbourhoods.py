"""Neighbourhoods annealed anew: allowed results, none worse, equal ones for equal seeds."""

from __future__ import annotations

import time

import numpy as np
import pytest

from decmcts._kernels.random import seeded
from decmcts._kernels.sequence.tour import respects
from decmcts.search.decomposition.threads import open_threads
from decmcts.search.hybrid.neighbourhoods import Neighbourhoods, Places
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.stopping import Stopping
from tests.search.decomposition.test_contraction import found, varied
from tests.search.problems import random_problem

TO_THE_END = Neighbourhoods(until=1.0)
CASES = [0, 1, 2, 3]  # points, loops, seconds, bare costs; see `varied`


def improved(seed: int, iterations: int, neighbourhoods: Neighbourhoods = TO_THE_END) -> Incumbent:
    """The incumbent after neighbourhoods of a poor sequence were annealed."""
    problem = varied(seed)
    incumbent = Incumbent(
        problem,
        clock=time.monotonic,
        stopping=Stopping(iterations=iterations),
    )
    start = found(problem, seed, iterations=10)
    incumbent.offer(start.order, start.reversed, start.entry_id)
    with open_threads(2, seed) as threads:
        for _ in neighbourhoods.improve(incumbent, start, threads):
            if incumbent.over:
                break
    return incumbent


@pytest.mark.slow
@pytest.mark.parametrize("seed", CASES)
def test_they_improve_and_stay_allowed(seed: int) -> None:
    """What comes out is a better linear extension, with directions and entries allowed."""
    incumbent = improved(seed, 200_000)
    problem, before = incumbent.problem, found(incumbent.problem, seed, iterations=10).cost
    assert incumbent.cost < before
    assert sorted(incumbent.order.tolist()) == list(range(len(problem)))
    assert respects(incumbent.order, problem.graph.succ_offsets, problem.graph.succs)
    assert not (incumbent.reversed & ~problem.reversible).any()


@pytest.mark.slow
@pytest.mark.parametrize("seed", CASES)
def test_equal_seeds_and_iterations_give_equal_sequences(seed: int) -> None:
    """With a budget of iterations the clock has no say."""
    one, other = improved(seed, 20_000), improved(seed, 20_000)
    assert one.cost == other.cost
    assert (one.order == other.order).all()
    assert one.iterations == other.iterations <= 21_000  # a slice, or a window, that is begun ends


@pytest.mark.slow
def test_loops_find_better_entries() -> None:
    """Single contours keep their entries: neighbourhoods of loops end with other entries."""
    problem = varied(1)
    start, incumbent = found(problem, 1, iterations=10), improved(1, 40_000)
    assert (incumbent.entry_id != start.entry_id).any()


@pytest.mark.slow
def test_a_neighbourhood_is_some_contours_but_not_all() -> None:
    """Balls have the size asked for, parts of the sequence no more."""
    problem = random_problem(3, 300, density=0.01)
    sequence, state = found(problem, 3, iterations=10), seeded(1)
    places = Places.of(sequence)
    sizes = [int(places.draw(sequence, 60, state).sum()) for _ in range(40)]
    assert max(sizes) == 60
    assert 10 <= min(sizes) < 60
    assert len({tuple(np.flatnonzero(places.draw(sequence, 60, state))) for _ in range(20)}) > 10


@pytest.mark.slow
@pytest.mark.parametrize("seed", CASES)
def test_parts_of_a_large_print_are_put_back_whole(seed: int) -> None:
    """Neighbourhoods within parts: the result is complete, allowed, better and repeatable."""
    in_parts = Neighbourhoods(until=1.0, whole=20, part=30)
    incumbent, again = improved(seed, 40_000, in_parts), improved(seed, 40_000, in_parts)
    problem = incumbent.problem
    assert incumbent.cost < found(problem, seed, iterations=10).cost
    assert sorted(incumbent.order.tolist()) == list(range(len(problem)))
    assert respects(incumbent.order, problem.graph.succ_offsets, problem.graph.succs)
    assert (incumbent.order == again.order).all()
    assert incumbent.cost == again.cost


def test_windows_leave_some_time_for_annealing() -> None:
    """With all of it a limit of iterations was divided by zero."""
    for share in (-0.1, 1.0):
        with pytest.raises(ValueError, match="below 1"):
            Neighbourhoods(windows=share)
