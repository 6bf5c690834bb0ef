"""The least time of motion: exact where nothing but motion happens, never more than it takes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from decmcts.print.job import PrintJob, ProcessSettings
from decmcts.print.machine import MotionLimits
from decmcts.print.motion import contour_times, path_times
from decmcts.print.plan import ActionKind
from sim.faults import FaultKind
from sim.replay.least import corner_at_most, from_rest, least_arrivals, least_time, least_times
from sim.verify import verify_plan

LIMITS = [
    MotionLimits(),
    MotionLimits(junction_deviation=0.02),
    MotionLimits(jerk=(0.0, 0.0, 0.0, 0.0), max_acceleration=(500.0, 900.0, 40.0, 5000.0)),
]


def least_of(path: np.ndarray, offsets: np.ndarray, feed: np.ndarray, limits: MotionLimits):
    """Least seconds of each polyline, at the acceleration of travels."""
    step = np.diff(path, axis=0, prepend=path[:1])
    length = np.linalg.norm(step, axis=1)
    unit = step / np.maximum(length, 1e-12)[:, None]
    along = np.maximum(np.abs(unit), 1e-9)
    speed = np.minimum(feed, (np.array(limits.max_feed[:3]) / along).min(axis=1))
    rate = (np.array(limits.max_acceleration[:3]) / along).min(axis=1)
    rate = np.minimum(rate, limits.travel_acceleration)
    first = np.zeros(len(path), np.bool_)
    first[offsets[:-1]] = True
    length[first] = 0.0
    jerk = np.array(limits.jerk[:3])
    seconds = least_times(length, unit, speed, rate, first, jerk, limits.junction_deviation)
    return np.add.reduceat(seconds, offsets[:-1])


@pytest.mark.parametrize("limits", LIMITS, ids=["jerk", "deviation", "no jerk"])
@pytest.mark.parametrize("seed", range(4))
def test_the_least_time_is_that_of_travels_and_never_more(limits, seed):
    """A travel is motion alone, so nothing is lost; more would refuse good plans."""
    rng = np.random.default_rng(seed)
    sizes = rng.integers(1, 12, 60)
    offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    path = np.round(rng.normal(0.0, 10.0, (offsets[-1], 3)) * rng.choice([0.01, 1.0, 20.0]), 3)
    path[rng.random(len(path)) < 0.1] = path[0]
    feed = rng.uniform(5.0, 300.0, len(path))
    takes, least = path_times(path, offsets, feed, limits), least_of(path, offsets, feed, limits)
    assert (least <= takes + 1e-9).all()
    assert least.sum() >= 0.97 * takes.sum()


def test_a_long_line_takes_its_ramps():
    """From rest to 100 mm/s and back at 1000 mm/s² over 100 mm: 1.1 s."""
    assert least_time(100.0, 0.0, 0.0, 100.0, 1000.0) == pytest.approx(1.1)
    assert least_time(1.0, 50.0, 0.0, 100.0, 1000.0) == pytest.approx(1.0 / 50.0)
    assert least_time(1.0, 0.0, 0.0, 100.0, math.inf) == pytest.approx(0.01)


def test_corners():
    """Straight on costs nothing; a reversal stops at the jerk, as a begin from rest does."""
    x, jerk = np.array([1.0, 0.0, 0.0]), np.array([8.0, 8.0, 2.0])
    assert corner_at_most(x, x, 1000.0, jerk, 0.0) == math.inf
    assert corner_at_most(x, -x, 1000.0, jerk, 0.0) == pytest.approx(8.0)
    assert from_rest(x, 100.0, jerk, 0.0) == pytest.approx(8.0)
    assert corner_at_most(x, x, 1000.0, jerk, 0.05) == math.inf
    assert corner_at_most(x, -x, 1000.0, jerk, 0.05) == 0.0
    assert from_rest(x, 100.0, jerk, 0.05) == 0.0


@pytest.mark.parametrize(
    ("points", "takes"),
    [
        ([[0, 0, 0], [10, 0, 0]], 0.2),  # a triangle: full speed is never reached
        ([[0, 0, 0], [30, 0, 0], [100, 0, 0]], 1.1),  # straight on, nothing is lost
        ([[0, 0, 0], [50, 0, 0], [50, 50, 0]], 1.2),  # a sharp corner without jerk is a stop
        ([[0, 0, 0], [0, 0, 10]], 1.1),  # z has limits of its own
        ([[1, 2, 3], [1, 2, 3]], 0.0),
    ],
)
def test_paths_take_their_trapezoids(points, takes):
    """100 mm/s, of z 10, reached in 0.1 s."""
    limits = MotionLimits(
        max_feed=(100.0, 100.0, 10.0, 50.0), max_acceleration=(1000.0, 1000.0, 100.0, 1000.0),
        jerk=(0.0, 0.0, 0.0, 0.0), travel_acceleration=1000.0,
    )  # fmt: skip
    path, offsets = np.array(points, float), np.array([0, len(points)])
    assert least_of(path, offsets, np.full(len(path), 100.0), limits)[0] == pytest.approx(takes)


def in_time_of(document, factor: float):
    """The plan with its times multiplied."""
    heads = tuple(
        replace(
            head, begin_s=head.begin_s * factor, end_s=head.end_s * factor,
            after_lag_s=head.after_lag_s * factor,
        )
        for head in document.plan.heads
    )  # fmt: skip
    return replace(document, plan=replace(document.plan, heads=heads))


@pytest.mark.parametrize("factor", [0.1, 0.5])
def test_a_plan_faster_than_its_motion_is_seen(make, factor):
    """Its times keep the order, and no machine can do it."""
    document = make.timed(make.two_head_plan(), 0.0)
    assert verify_plan(document).ok
    assert verify_plan(in_time_of(document, factor)).kinds() == {FaultKind.TIMES}


def test_one_print_in_half_its_time_is_seen(make):
    """All others have theirs."""

    def halved(rows):
        rows[3]["end_s"] = (rows[3]["begin_s"] + rows[3]["end_s"]) / 2.0

    document = make.timed(make.tower_plan(), 0.0)
    assert verify_plan(document).ok
    verdict = verify_plan(make.edited(document, 0, halved))
    assert verdict.kinds() == {FaultKind.TIMES} and len(verdict.faults) == 1


def test_a_source_states_feeds_and_accelerations(make):
    """Without it travels may have any feed; with it none but the source's."""
    document = make.tower_plan()
    head = document.plan.heads[0]
    ends = head.path_offsets[1:] - 1
    unknown = least_arrivals(document, head, None, rests=False)[ends]
    job = PrintJob("made", document.contours, ProcessSettings(travel_feed=50.0))
    known = least_arrivals(document, head, job, rests=False)[ends]
    paths = [head.action_path(a) for a in range(len(head))]
    length = np.array([np.linalg.norm(np.diff(path, axis=0), axis=1).sum() for path in paths])
    assert (known >= length / 50.0 - 1e-9).all() and (unknown <= known).all()
    assert unknown[0] < 0.5 * known[0]


def test_hops_between_stretches_of_a_contour_accelerate_as_travels_do(make):
    """Nothing is printed in them; the planner's own time for such a contour can be kept."""
    document = make.tower_plan()
    head, contours = document.plan.heads[0], document.contours
    hops = contours.extrusion.copy()
    hops[2::2] = 0.0
    contours = replace(contours, extrusion=hops, feed=np.full(len(hops), 150.0))
    settings = ProcessSettings(travel_feed=150.0, travel_acceleration=5000.0)
    least = least_arrivals(
        replace(document, contours=contours), head, PrintJob("made", contours, settings), rests=True
    )
    limits = replace(document.machine.limits, travel_acceleration=5000.0)
    takes = contour_times(contours, limits)
    prints = np.flatnonzero(head.kind == ActionKind.PRINT)
    least = least[head.path_offsets[prints + 1] - 1]
    assert (least <= takes[head.contour[prints]] + 1e-9).all()
    assert (least > 0.5 * takes[head.contour[prints]]).all()


@pytest.mark.parametrize("name", ["makespan_s", "emitted_travel_mm", "contours"])
def test_figures_that_are_not_the_actions_are_seen(make, name):
    """Whoever compares plans reads these, not the actions."""
    document = make.tower_plan()
    verdict = verify_plan(replace(document, metrics={name: 3.0}))
    assert verdict.kinds() == {FaultKind.TIMES} and name in str(verdict.faults[0])
    assert not verify_plan(replace(document, metrics={name: "3"})).ok
    assert verify_plan(replace(document, metrics={name: 10**400})).kinds() == {FaultKind.TIMES}


@pytest.mark.parametrize("stated", [{"cuts": 10**400}, {"cuts": True}, {"cut": 1}, [1], 3, "none"])
def test_what_is_said_of_cuts_of_an_uncut_print_is_a_fault(make, stated):
    """However it is said; nothing of it stops the judge."""
    verdict = verify_plan(replace(make.tower_plan(), metrics={"cut": stated}))
    assert verdict.kinds() == {FaultKind.WELD}


def test_accelerations_that_a_plan_states_count(make):
    """With 100 mm/s² instead of the machine's the same times are too short, without any source."""
    document = make.tower_plan()
    n = len(document.contours.points)
    assert verify_plan(replace(document, acceleration=np.zeros(n))).ok
    verdict = verify_plan(replace(document, acceleration=np.full(n, 100.0)))
    assert verdict.kinds() == {FaultKind.TIMES}
