"""Waits for a point within another head's action, with a lag, judged for every timing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.print.plan import ACTION_END, ActionKind
from sim.content.paths import legs_of
from sim.faults import FaultKind
from sim.replay.execution import execute, run_trial, timing_factors
from sim.replay.fenced import beads_for
from sim.rules.order import order_of
from sim.verify import all_actions_of, verify_plan

ENOUGH = 5  # the first point of the shared plan at which the other head may begin


def waiting_for(make, *edges, **options):
    """Return the verdict on the shared plan with these waits."""
    return verify_plan(make.shared_plan(edges, **options), trials=2)


@pytest.mark.parametrize("rail", [False, True])
def test_a_head_may_begin_when_the_other_has_passed_a_point(make, rail):
    """Room is released piece by piece; no replay, by action or by leg, sees a contact."""
    verdict = waiting_for(make, (0, 1, ENOUGH), rail=rail)
    assert verdict.ok, verdict.shown
    assert verdict.counts["contacts"] == 0
    assert verdict.counts["replays"] == (1 + 2 + 2 + 2) + (2 + 2)


@pytest.mark.parametrize(("rail", "kind"), [(False, FaultKind.HEAD_HEAD), (True, FaultKind.RAIL)])
def test_one_point_too_early_is_a_contact(make, rail, kind):
    """The judge names the action and from which point on it is too near."""
    verdict = waiting_for(make, (0, 1, ENOUGH - 1), rail=rail)
    assert kind in verdict.kinds()
    said = [f.text for f in verdict.faults if f.kind == kind and "replay" not in f.text]
    assert any("head left action 1 (print contour 0), points 4 to 8" in text for text in said)


def test_without_the_wait_replays_see_the_contact(make):
    """What the exact check refuses happens in time, too."""
    verdict = waiting_for(make)
    assert FaultKind.HEAD_HEAD in verdict.kinds()
    assert verdict.counts["contacts"] > 0


def test_the_last_point_is_as_good_as_the_end(make):
    """Nothing moves between the last point and the end."""
    for edge in ((0, 1, 8), (0, 1, ACTION_END), (0, 1)):
        legs = legs_of(all_actions_of(make.shared_plan([edge])))
        assert not legs.cut
        assert waiting_for(make, edge).ok


def test_heads_that_signal_only_at_rest_are_not_waited_for_at_points(make):
    """The machine says what its controllers can do; a plan asks for no more."""
    for edge, ok in (((0, 1, ENOUGH), False), ((0, 1), True)):
        document = make.shared_plan([edge])
        verdict = verify_plan(
            replace(document, machine=replace(document.machine, release="action"))
        )
        assert verdict.ok is ok
        assert ok or verdict.shown == (
            "machine: head right action 0 (travel) waits for point 5 of head left action 1 "
            "(print contour 0); heads of two signal only that an action has ended"
        )


def test_a_point_of_a_later_action_is_a_deadlock(make):
    """Each head waits for what the other does only once it has been waited for."""
    document = make.shared_plan([(0, 1, ENOUGH)])

    def wait_too(rows):
        rows[0]["after"] = [(1, 1, 2)]

    verdict = verify_plan(make.edited(document, 0, wait_too))
    assert [f.text for f in verdict.faults if f.kind == FaultKind.DEADLOCK] == [
        "head left action 0 (travel) can never begin",
        "head right action 0 (travel) can never begin",
    ]


@pytest.mark.parametrize(
    ("edge", "message"),
    [
        ((0, 1, 0), "waits for point 0 of head left action 1 (print contour 0), points to pass: 1"),
        ((0, 1, 9), "points to pass: 1 to 8"),
        ((0, 1, -2), "waits for point -2"),
        ((0, 3, 1), "action 3 of head number 0, which is not there"),
        ((0, 1, 5, -1.0), "waits -1 s after head left action 1"),
        ((0, 1, 5, np.nan), "waits nan s"),
        ((0, 1, 5, 1e9), "waits 1e+09 s"),
    ],
)
def test_points_and_lags_that_mean_nothing_are_refused(make, edge, message):
    """A plan made in memory is checked as one that was read."""
    verdict = waiting_for(make, edge)
    assert verdict.kinds() == {FaultKind.WRONG_PATH}
    assert message in verdict.shown


def test_a_point_of_a_head_that_stands_still_is_refused(make):
    """A wait passes nothing."""

    def stand(rows):
        here = rows[1]["path"][:1]
        wait = {**rows[0], "kind": ActionKind.WAIT, "path": np.repeat(here, 3, axis=0)}
        rows.insert(1, wait)

    document = make.edited(make.shared_plan([(0, 1, 1)]), 0, stand)
    verdict = verify_plan(document)
    assert "waits for point 1 of head left action 1 (wait), points to pass: none" in verdict.shown


def test_a_contour_that_must_end_first_is_not_done_at_a_point(make):
    """J2 asks for the end, wherever the room was released."""
    for edge, ok in (((0, 1, 7), False), ((0, 1), True)):
        document = make.shared_plan([edge])
        document = replace(document, precedence=np.array([[0, 1]], np.int32))
        verdict = verify_plan(document)
        assert verdict.ok is ok
        assert ok or verdict.kinds() == {FaultKind.PRECEDENCE}


def test_beads_may_be_there_unless_ordered_later(make):
    """A contour is material from its first leg on; its own head meets it once it is done.

    Printed as sliced it may climb over itself, whoever waits midway.
    """

    def wait_too(rows):
        rows[0]["after"] = [(1, 1, 2)]

    document = make.edited(make.shared_plan([]), 0, wait_too)
    legs = legs_of(all_actions_of(document))
    order = order_of(legs.all_actions)
    beads = beads_for(document.contours, legs, order, 1)
    travel, line = 3, 4  # moves of the right head
    assert set(beads.since[beads.label == 0]) == {travel + 2}
    assert set(beads.since[beads.label == 1]) == {travel + line}
    left = beads_for(document.contours, legs, order, 0)
    assert set(left.since[left.label == 1]) == {0}


def test_a_lag_counts_from_when_the_point_was_passed(make):
    """Replays wait the lag out, however fast or slow the other head is."""
    document = make.shared_plan([(0, 1, ENOUGH, 7.0)])
    all_actions = all_actions_of(document)
    legs, arrivals = (
        legs_of(all_actions),
        [make.arrivals_of(document, actions) for actions in all_actions],
    )
    passing = [legs.arrivals(h, times) for h, times in enumerate(arrivals)]
    first = all_actions[0].path_offsets[1]
    for _, factors in timing_factors(legs, 3, seed=1):
        courses = run_trial(
            document.machine, legs.all_actions, order_of(legs.all_actions), passing, factors
        )
        travel = factors[0][0] * arrivals[0][first - 1]
        passed = travel + factors[0][1] * arrivals[0][first + ENOUGH]
        begun = courses[1].time[courses[1].action == 0][0]
        assert begun == pytest.approx(passed + 7.0)


def test_nominal_times_wait_for_the_point_and_the_lag(make):
    """Printing 50 mm at 30 mm/s takes 1.67 s at least, and never longer than the action."""

    def at(begin_s):
        def change(rows):
            later = begin_s - rows[0]["begin_s"]
            for row in rows:
                row["begin_s"] += later
                row["end_s"] += later

        return change

    def slow(rows):
        rows[1]["end_s"] += 9.0
        rows[2]["begin_s"] += 9.0
        rows[2]["end_s"] += 9.0

    document = make.edited(make.shared_plan([(0, 1, ENOUGH, 1.0)]), 0, slow)
    begun = float(document.plan.heads[0].begin_s[1])
    due = begun + 50.0 / 30.0 + 1.0  # begin of the left head's print, the way there, the lag
    for begin_s, ok in ((due, True), (due - 0.1, False)):
        verdict = verify_plan(make.edited(document, 1, at(begin_s)))
        assert verdict.ok is ok
        assert ok or verdict.kinds() == {FaultKind.TIMES}


@pytest.mark.parametrize("seed", range(8))
def test_legs_wait_as_the_actions_do(make, seed):
    """Times by legs are those of a slow walk over the actions' own points and lags."""
    rng = np.random.default_rng(seed)
    all_actions = tuple(
        replace(actions, after_lag_s=rng.choice([0.0, 2.5], len(actions.after_head)))
        for actions in make.actions_with_points(rng)
    )
    legs = legs_of(all_actions)
    takes = [rng.uniform(0.1, 2.0, (len(actions), 3)) for actions in all_actions]  # of each move
    seconds = [
        np.array([takes[h][o][(r := rows[a:b] % 4)[0] : r[-1]].sum() for o, a, b in zip(
            legs.origin[h], leg.path_offsets, leg.path_offsets[1:], strict=False)])
        for h, (leg, rows) in enumerate(zip(legs.all_actions, legs.rows, strict=True))
    ]  # fmt: skip
    begin = execute(legs.all_actions, order_of(legs.all_actions), seconds)

    def begins(h, a):
        due = [begins(h, a - 1) + takes[h][a - 1].sum()] if a else [0.0]
        for e in all_actions[h].after_edges(a):
            moves = takes[e.head][e.action][: None if e.point == ACTION_END else e.point]
            due.append(begins(e.head, e.action) + moves.sum() + e.lag_s)
        return max(due)

    for h, actions in enumerate(all_actions):
        first = np.searchsorted(legs.origin[h], np.arange(len(actions)))
        assert begin[h][first] == pytest.approx([begins(h, a) for a in range(len(actions))])


def test_points_that_were_not_cut_are_no_order(make):
    """An order of whole actions would take a point for the end, which is not safe."""
    all_actions = all_actions_of(make.shared_plan([(0, 1, ENOUGH)]))
    with pytest.raises(ValueError, match="cut into legs"):
        order_of(all_actions)
