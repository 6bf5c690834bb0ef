"""Replays: begin times keep the order, and contacts are seen in time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.print.loops import traversal
from decmcts.print.machine import MotionLimits
from decmcts.print.plan import ActionKind
from sim.content.paths import legs_of
from sim.faults import FaultKind
from sim.replay.execution import (
    TimedPath,
    _near_pieces,
    execute,
    run_trial,
    shared_pieces,
    timing_factors,
)
from sim.replay.least import print_feed, print_feeds
from sim.rules.order import order_of
from sim.verify import all_actions_of, verify_plan


def forget_after(rows):
    for row in rows:
        row["after"] = []


def test_execution_begins_as_early_as_allowed(make):
    """Each action begins when the last thing it waits for has ended, not before, not later."""
    all_actions = all_actions_of(make.two_head_plan())
    order = order_of(all_actions)
    rng = np.random.default_rng(0)
    seconds = [rng.uniform(0.1, 2.0, len(actions)) for actions in all_actions]
    begin = execute(all_actions, order, seconds)
    for h, actions in enumerate(all_actions):
        for a in range(len(actions)):
            waits = [begin[s][b] + seconds[s][b] for s, b in actions.after(a)]
            if a:
                waits.append(begin[h][a - 1] + seconds[h][a - 1])
            assert begin[h][a] == max(waits, default=0.0)


def test_adversarial_timing_is_among_the_trials(make):
    """Random error alone rarely makes one head twice as fast for the whole print."""
    all_actions = all_actions_of(make.two_head_plan())
    trials = dict(timing_factors(legs_of(all_actions), 2, seed=7))
    assert set(trials) == {
        "nominal", "random 0", "random 1", "head left fast", "head right fast",
        "in turn 0", "in turn 1",
    }  # fmt: skip
    assert set(trials["head left fast"][0]) == {0.5}
    assert set(trials["head left fast"][1]) == {2.0}
    for factors in trials.values():
        assert all(((f >= 0.5) & (f <= 2.0)).all() for f in factors)


def test_equal_seeds_give_equal_trials(make):
    """A fault found once must be found again."""
    all_actions = all_actions_of(make.two_head_plan())
    one, two = (dict(timing_factors(legs_of(all_actions), 2, seed=3)) for _ in range(2))
    assert all(
        np.array_equal(a, b) for name in one for a, b in zip(one[name], two[name], strict=True)
    )


def test_a_meeting_in_time_is_seen(make):
    """Without the wait the right head runs into the left one in at least one replay."""
    document = make.edited(make.two_head_plan(rail=False), 1, forget_after)
    verdict = verify_plan(document)
    assert any(f.kind == FaultKind.HEAD_HEAD and "replay" in f.text for f in verdict.faults)
    assert verdict.counts["contacts"] > 0


def test_a_head_that_waits_its_turn_is_never_met(make):
    """The same plan with the wait has no contact in any replay."""
    verdict = verify_plan(make.two_head_plan(rail=False), trials=5)
    assert verdict.counts["contacts"] == 0
    assert verdict.counts["replays"] == 10


def test_a_head_rests_where_it_ended(make):
    """Between two actions the course holds the last point, through any wait."""
    document = make.two_head_plan()
    all_actions = all_actions_of(document)
    arrivals = [make.arrivals_of(document, actions) for actions in all_actions]
    _, factors = next(timing_factors(legs_of(all_actions), 0, 0))
    courses = run_trial(document.machine, all_actions, order_of(all_actions), arrivals, factors)
    waits = next(a for a in range(len(all_actions[1])) if all_actions[1].after(a))
    end = courses[1].time[courses[1].action == waits - 1][-1]
    begun = courses[1].time[courses[1].action == waits][0]
    assert begun > end
    here = np.interp((end + begun) / 2, courses[1].time, courses[1].point[:, 0])
    assert here == all_actions[1].action_path(waits)[0, 0]


def test_a_head_moves_under_its_own_limits(make):
    """A slower head beside a quicker one is slower in the replay too."""
    document = make.two_head_plan()
    left, right = document.machine.heads
    slow = MotionLimits(travel_feed=15.0, max_feed=(15.0, 15.0, 2.0, 60.0))
    machine = replace(document.machine, heads=(left, replace(right, limits=slow)))
    before, after = (
        [make.arrivals_of(d, actions)[-1] for actions in all_actions_of(d)]
        for d in (document, replace(document, machine=machine))
    )
    assert after[0] == before[0]
    assert after[1] > 3.0 * before[1]


def test_print_feeds_follow_the_traversal(make):
    """A contour that is reversed runs its feeds backwards."""
    document = make.tower_plan(layers=1, towers=((20.0, 20.0),))
    feed = np.array([0.0, 10.0, 20.0, 30.0, 40.0])
    document = replace(document, contours=replace(document.contours, feed=feed))
    forward = np.diff(make.arrivals_of(document, document.plan.heads[0])[4:9])

    def reverse(rows):
        rows[1]["path"], rows[1]["reversed"] = rows[1]["path"][::-1].copy(), True

    edited = make.edited(document, 0, reverse)
    backward = np.diff(make.arrivals_of(edited, edited.plan.heads[0])[4:9])
    np.testing.assert_allclose(backward, forward[::-1])


@pytest.mark.parametrize("seed", range(6))
def test_feeds_at_once_are_the_feeds_of_each(make, seed):
    """Prints either way round, from any vertex, and one with a point too few."""
    rng = np.random.default_rng(seed)
    square = np.array([[0, 0, 0.2], [9, 0, 0.2], [9, 9, 0.2], [0, 9, 0.2], [0, 0, 0.2]], float)
    plain = [rng.uniform(0, 20, (int(n), 3)) for n in rng.integers(2, 6, 8)]
    contours = make.contours_of([*plain, square])
    contours = replace(contours, feed=rng.uniform(10, 60, len(contours.points)))
    rows, paths = [], []
    for c in rng.permutation(len(contours)).tolist():
        path, back = contours.polyline(c), bool(rng.integers(2))
        rows += [(ActionKind.TRAVEL, -1, False), (ActionKind.PRINT, c, back)]
        paths += [np.zeros((2, 3)), path[::-1] if back else path]
    paths[1] = paths[1][:-1]
    actions = make.actions_of_rows("a", rows, paths, [[]] * len(rows))
    at = next(a for a, row in enumerate(rows) if row[1] == 8)
    entry = np.zeros(len(rows), np.int32)
    if at != 1 and not rows[at][2]:
        entry[at] = 2
        actions.path[actions.path_offsets[at] : actions.path_offsets[at + 1]] = traversal(
            contours, 8, 2
        ).points
    actions = replace(actions, entry=entry)
    due = np.full(len(actions.path), np.nan)
    for a, row in enumerate(rows):
        feed = print_feed(contours, actions, a) if row[0] == ActionKind.PRINT else []
        if len(feed) == len(paths[a]) - 1 and a != 1:
            due[actions.path_offsets[a] + 1 : actions.path_offsets[a + 1]] = feed
    assert np.isfinite(due).sum() > 10
    np.testing.assert_array_equal(print_feeds(contours, actions), due)


def random_course(rng, n, end):
    """Return a course with times that both heads may share, some twice."""
    time = np.concatenate([[0.0], np.sort(rng.integers(0, end * 2 + 1, n)) / 2.0, [end]])
    point = rng.uniform(0, 100, (n + 2, 3))
    same = np.flatnonzero(np.diff(time) == 0)
    for k in same.tolist():
        point[k + 1] = point[k]
    return TimedPath(time, point, np.concatenate([[-1], np.arange(n + 1)]))


@pytest.mark.parametrize("seed", range(6))
def test_two_courses_on_one_time_axis_are_where_they_were(seed):
    """Both heads' points by interpolation, and their actions by a look at the middle of a piece."""
    rng = np.random.default_rng(seed)
    courses = [random_course(rng, 30, 20.0), random_course(rng, 12, 20.0)]
    pieces = shared_pieces(courses)[0]
    time = pieces.time
    np.testing.assert_array_equal(time, np.unique(np.concatenate([c.time for c in courses])))
    middle = np.append((time[1:] + time[:-1]) / 2, time[-1])
    for h, (course, points) in enumerate(zip(courses, (pieces.a, pieces.b), strict=True)):
        for d in range(3):
            where = np.interp(time, course.time, course.point[:, d])
            np.testing.assert_allclose(points[:, d], where, rtol=0, atol=1e-12)
        at = np.searchsorted(course.time, middle, side="right") - 1
        np.testing.assert_array_equal(pieces.actions[:, h], course.action[at])


@pytest.mark.parametrize("seed", range(4))
def test_near_pieces_are_those_whose_boxes_overlap(seed):
    """A piece that is left out is never looked at again."""
    rng = np.random.default_rng(seed)
    pieces = shared_pieces([random_course(rng, 40, 30.0), random_course(rng, 40, 30.0)])[0]
    a_box, b_box, reach = np.array([[-9.0] * 3, [5.0] * 3]), np.array([[-4.0] * 3, [8.0] * 3]), 2.0
    every = np.arange(len(pieces.time) - 1)
    due = []
    for k in every.tolist():
        mine, theirs = pieces.a[k : k + 2], pieces.b[k : k + 2]
        low, high = mine.min(axis=0) + a_box[0] - reach, mine.max(axis=0) + a_box[1] + reach
        over = theirs.max(axis=0) + b_box[1] > low
        if (over & (theirs.min(axis=0) + b_box[0] < high)).all():
            due.append(k)
    assert 0 < len(due) < len(every)
    assert _near_pieces(pieces, every, a_box, b_box, reach).tolist() == due
