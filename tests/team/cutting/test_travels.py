"""Less travel within the runs of a sweep: nothing leaves its run, and heads may do it."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.planning.events import unheard
from decmcts.planning.options import Cut
from decmcts.planning.problem.print_problem import load
from decmcts.planning.team.cutting import best_sweep
from decmcts.team.cutting.sweep import with_less_travel
from decmcts.team.engine.plans import StatedOrder
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import is_allowed
from tests.prints import slab


@pytest.fixture(scope="module")
def problem(tmp_path_factory: pytest.TempPathFactory) -> TeamProblem:
    """A slab cut for two heads."""
    source = slab(tmp_path_factory.mktemp("slab") / "slab.gcode")
    found = best_sweep(load(source, "dual-gantry"), Cut.ALL, unheard)
    assert found is not None
    return found.team


def in_source_order(problem: TeamProblem) -> tuple[StatedOrder, np.ndarray]:
    """Return the pieces in the source's order, each half of a layer one head's, as a run."""
    contours, boxes = problem.job.contours, problem.space.boxes
    head = (boxes[:, :2].mean(axis=1) > boxes[:, :2].mean()).astype(np.int64)
    n = len(contours)
    stated = StatedOrder(np.arange(n, dtype=np.int32), np.zeros(n, np.bool_), head)
    change = (np.diff(head, prepend=-1) != 0) | (np.diff(contours.layer, prepend=-1) != 0)
    return stated, np.cumsum(change)


def travel_mm(problem: TeamProblem, stated: StatedOrder) -> float:
    """Return how far the heads travel between contours."""
    total, side = 0.0, stated.reversed.astype(np.int64)
    for r in range(2):
        mine = np.flatnonzero(stated.head == r)
        ends = problem.visits.ends[stated.order[mine]]
        rows = np.arange(len(mine))
        gaps = ends[rows, side[mine]][1:] - ends[rows, 1 - side[mine]][:-1]
        total += float(np.linalg.norm(gaps, axis=1).sum())
    return total


def test_runs_keep_what_is_theirs_and_travels_get_shorter(problem: TeamProblem) -> None:
    """Else heads would no longer be in step, or the order would break what comes before what."""
    stated, run = in_source_order(problem)
    found = with_less_travel(problem, stated, run)
    assert is_allowed(problem, found, problem.space.eligible)
    assert np.array_equal(found.head, stated.head)
    for number in np.unique(run):
        turns = run == number
        assert set(found.order[turns]) == set(stated.order[turns])
    assert travel_mm(problem, found) < 0.9 * travel_mm(problem, stated)


def test_equal_input_gives_the_same_order(problem: TeamProblem) -> None:
    """Heads are searched for on threads, and may not depend on which is faster."""
    stated, run = in_source_order(problem)
    first, second = (with_less_travel(problem, stated, run) for _ in range(2))
    assert np.array_equal(first.order, second.order)
    assert np.array_equal(first.reversed, second.reversed)


def test_runs_of_one_contour_stay(problem: TeamProblem) -> None:
    """There is nothing to choose between them but their direction."""
    stated, run = in_source_order(problem)
    found = with_less_travel(problem, stated, np.arange(len(run)))
    assert np.array_equal(found.order, stated.order)
    assert is_allowed(problem, found, problem.space.eligible)


def test_a_head_may_have_nothing_to_print(problem: TeamProblem) -> None:
    """A part that one head prints alone is swept too."""
    stated, _ = in_source_order(problem)
    alone = StatedOrder(stated.order, stated.reversed, np.zeros_like(stated.head))
    found = with_less_travel(problem, alone, np.asarray(problem.job.contours.layer, np.int64))
    assert is_allowed(problem, found, problem.space.eligible)
    assert travel_mm(problem, found) < travel_mm(problem, alone)
