"""Replays: begin times keep the order, and contacts are seen in time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from decmcts.print.machine import MotionLimits
from sim.content.legs import legs_of
from sim.faults import FaultKind
from sim.replay.execution import arrivals_of, execute, run_trial, timing_factors
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
    arrivals = [arrivals_of(document, actions) for actions in all_actions]
    _, factors = next(timing_factors(legs_of(all_actions), 0, 0))
    begin, courses = run_trial(
        document.machine, all_actions, order_of(all_actions), arrivals, factors
    )
    waits = next(a for a in range(len(all_actions[1])) if all_actions[1].after(a))
    end = courses[1].time[courses[1].action == waits - 1][-1]
    assert begin[1][waits] > end
    here = np.interp((end + begin[1][waits]) / 2, courses[1].time, courses[1].point[:, 0])
    assert here == all_actions[1].action_path(waits)[0, 0]


def test_a_head_moves_under_its_own_limits(make):
    """A slower head beside a quicker one is slower in the replay too."""
    document = make.two_head_plan()
    left, right = document.machine.heads
    slow = MotionLimits(travel_feed=15.0, max_feed=(15.0, 15.0, 2.0, 60.0))
    machine = replace(document.machine, heads=(left, replace(right, limits=slow)))
    before, after = (
        [arrivals_of(d, actions)[-1] for actions in all_actions_of(d)]
        for d in (document, replace(document, machine=machine))
    )
    assert after[0] == before[0]
    assert after[1] > 3.0 * before[1]


def test_print_feeds_follow_the_traversal(make):
    """A contour that is reversed runs its feeds backwards."""
    document = make.tower_plan(layers=1, towers=((20.0, 20.0),))
    feed = np.array([0.0, 10.0, 20.0, 30.0, 40.0])
    document = replace(document, contours=replace(document.contours, feed=feed))
    forward = np.diff(arrivals_of(document, document.plan.heads[0])[4:9])

    def reverse(rows):
        rows[1]["path"], rows[1]["reversed"] = rows[1]["path"][::-1].copy(), True

    edited = make.edited(document, 0, reverse)
    backward = np.diff(arrivals_of(edited, edited.plan.heads[0])[4:9])
    np.testing.assert_allclose(backward, forward[::-1])
