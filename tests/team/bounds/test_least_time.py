"""Heads of different speed: exact times are their own, and no plan beats the bound."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from decmcts.print.loops import enter_at
from decmcts.print.machine import MotionLimits
from decmcts.print.motion import contour_times
from decmcts.print.plan import ActionKind
from decmcts.print.seam import seam_entries
from decmcts.print.toolpath import Toolpath
from decmcts.team.bounds.makespan import least_times, makespan_bound
from decmcts.team.engine.problem import build_team_problem
from decmcts.team.engine.resolve import resolve
from decmcts.team.engine.space import build_space
from decmcts.team.schedule.joint_plan import schedule
from tests.team.schedule.test_joint_plan import random_split

SLOW = MotionLimits(max_feed=(10.0, 10.0, 20.0, 60.0))
FAST = MotionLimits(travel_feed=300.0, max_acceleration=(9000.0, 9000.0, 300.0, 5000.0))
FAST = replace(FAST, acceleration=9000.0, travel_acceleration=9000.0)


def uneven(case: Any) -> Any:
    """Return the case on a machine of slow heads, the right one fast by limits of its own."""
    left, right = case.machine.heads
    heads = (left, replace(right, limits=FAST))
    return replace(case, machine=replace(case.machine, heads=heads, limits=SLOW))


@pytest.mark.parametrize("seed", range(4))
def test_what_a_head_prints_takes_its_own_time(case: Callable[..., Any], seed: int) -> None:
    """The exact plan knows whose limits count, whatever the heads agreed by."""
    chosen = uneven(case(seed))
    plan = schedule(chosen.job, chosen.machine, chosen.graph, random_split(chosen, seed))
    for head, limits in zip(plan.heads, (SLOW, FAST), strict=True):
        prints = head.kind == ActionKind.PRINT
        due = contour_times(chosen.job.contours, limits)[head.contour[prints]]
        assert prints.any()
        assert (head.end_s - head.begin_s)[prints] == pytest.approx(due)


def test_a_fast_head_alone_does_not_beat_the_bound(case: Callable[..., Any]) -> None:
    """By the machine's own limits the bound was more than twice what that head takes."""
    chosen = uneven(case(0))
    order = Toolpath.as_sliced(len(chosen.job.contours))
    space = build_space(chosen.job, chosen.machine)
    assert space.eligible[:, 1].all()
    plan = schedule(chosen.job, chosen.machine, chosen.graph, [replace(order, **_nothing()), order])
    bound = makespan_bound(chosen.job, chosen.machine, chosen.graph)
    slow = contour_times(chosen.job.contours, SLOW)
    assert bound.bound_s <= plan.makespan_s < slow.sum() / 2.0
    assert bound.serial_s == pytest.approx(contour_times(chosen.job.contours, FAST).sum())


def _nothing() -> dict[str, Any]:
    none = np.zeros(0, np.int32)
    return {"order": none, "reversed": none.astype(np.bool_), "entry": none}


def test_who_may_not_print_does_not_count(case_of: Callable[..., Any]) -> None:
    """A stroke only the slow head reaches takes that head's time."""
    chosen = uneven(case_of([(2, 10, 0.5), (8, 10, 0.5)], [(90, 20, 0.5), (100, 20, 0.5)]))
    bound = makespan_bound(chosen.job, chosen.machine, chosen.graph)
    slow, fast = (contour_times(chosen.job.contours, limits) for limits in (SLOW, FAST))
    assert bound.exclusive_s == pytest.approx(slow[0])
    assert bound.serial_s == pytest.approx(slow[0] + fast[1])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_no_plan_of_uneven_heads_is_faster(case: Callable[..., Any], seed: int) -> None:
    """Whatever the heads agree on, and however a split falls."""
    chosen = uneven(case(seed, towers=8))
    bound = makespan_bound(chosen.job, chosen.machine, chosen.graph).bound_s
    problem = build_team_problem(chosen.job, chosen.machine, chosen.graph)
    for paths in (resolve(problem, {}, [0, 1]).toolpaths, random_split(chosen, seed)):
        plan = schedule(chosen.job, chosen.machine, chosen.graph, paths)
        assert bound <= plan.makespan_s


@pytest.mark.parametrize("seed", range(4))
def test_a_loop_takes_least_from_its_best_entry(case: Callable[..., Any], seed: int) -> None:
    """Against every entry timed one by one; segments take no more than as sliced."""
    chosen = uneven(case(seed))
    job, n = chosen.job, len(chosen.job.contours)
    points = job.contours.points.copy()
    for c in np.flatnonzero(job.contours.closed):  # a loop that begins within an edge
        first = int(job.contours.offsets[c])
        points[[first, first + 4]] = 0.5 * (points[first] + points[first + 1])
    job = replace(job, contours=replace(job.contours, points=points))
    entries, limits = seam_entries(job.contours), SLOW
    eligible = np.tile([True, False], (n, 1))
    contour, segment = least_times(job, chosen.machine, eligible, entries)
    sliced = least_times(job, chosen.machine, eligible)
    for c in range(n):
        every = []
        for vertex in entries.vertices[entries.offsets[c] : entries.offsets[c + 1]]:
            entry = np.zeros(n, np.int32)
            entry[c] = vertex
            every.append(contour_times(enter_at(job.contours, entry), limits)[c])
        assert contour[c] == pytest.approx(min(every))
    assert (contour < sliced[0] - 1e-6).any()
    assert (segment <= sliced[1]).all()
    whole = np.add.reduceat(segment, job.contours.offsets[:-1])
    assert (whole <= contour + 1e-9).all()
