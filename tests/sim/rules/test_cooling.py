"""The judge finds what is printed over too soon, and only that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.print.plan import NO_CONTOUR, ActionKind
from sim.faults import FaultKind
from sim.rules.cooling import PRINT_TIMES, _seconds
from sim.verify import verify_plan

WAIT_S = 6.0


@pytest.fixture
def towers(make):
    """Two towers, one printed after the other: 16 mm at 30 mm/s a layer of each."""
    return make.tower_plan(4)


def with_waits(make, document, seconds: float):
    """The plan with a wait before each travel but the first."""

    def change(rows):
        made = []
        for row in rows:
            if row["kind"] == ActionKind.TRAVEL and made:
                place = made[-1]["path"][-1:]
                wait = {**row, "kind": ActionKind.WAIT, "contour": NO_CONTOUR, "path": place}
                made.append({**wait, "begin_s": 0.0, "end_s": seconds})
            made.append(row)
        now = 0.0
        for row in made:
            spent = row["end_s"] - row["begin_s"]
            row["begin_s"], row["end_s"] = now, now + spent
            now += spent
        return made

    return make.edited(document, 0, change)


def test_a_tower_printed_at_once_is_seen(make, towers):
    """The source printed the other tower in between; this plan goes on at once."""
    assert verify_plan(towers).ok
    verdict = verify_plan(replace(towers, min_layer_time_s=0.0))
    assert verdict.ok
    verdict = verify_plan(with_rule(make, towers, 30.0))
    assert verdict.kinds() == {FaultKind.COOLING}
    assert "contour 2 begins 0.0 s after contour 0 under it" in str(verdict.faults[0])


def with_rule(make, document, rule: float):
    """Feeds of a slow print, so that a layer takes seconds, and the rule."""
    contours = document.contours
    slow = replace(contours, feed=contours.feed / 20.0)
    return make.timed(replace(document, contours=slow, min_layer_time_s=rule), 0.0)


def test_waits_make_it_good(make, towers):
    """A wait of the time that is due is enough, a shorter one is not."""
    due = 16.0 / 1.5
    assert verify_plan(with_rule(make, with_waits(make, towers, due), 30.0)).ok
    assert verify_plan(with_rule(make, with_waits(make, towers, WAIT_S), WAIT_S)).ok
    assert (
        FaultKind.COOLING
        in verify_plan(with_rule(make, with_waits(make, towers, 3.0), 30.0)).kinds()
    )


def test_the_source_order_owes_nothing(make):
    """In source order every spot has what the source gave it, whatever the rule."""
    document = make.tower_plan(4)
    paths = [document.contours.polyline(c) for c in range(len(document.contours))]
    actions = make.head_actions(
        document.machine.heads[0], [(c, False) for c in range(len(paths))], paths, 0, clearance_z=2
    )
    plan = replace(document.plan, heads=(actions,))
    assert verify_plan(with_rule(make, replace(document, plan=plan), 1000.0)).ok


@pytest.mark.parametrize(("stated", "taken"), [(0.5, 1.0), (2.0, 2.0), (9.0, PRINT_TIMES)])
def test_prints_may_be_slower_than_the_machine_but_not_by_any_factor(towers, stated, taken):
    """Slicers slow single lines down by M204, which the plan does not carry."""
    actions = towers.plan.heads[0]
    prints = actions.kind == ActionKind.PRINT
    own = np.where(prints, 4.0, actions.end_s - actions.begin_s)
    arrivals = np.zeros(len(actions.path))
    arrivals[actions.path_offsets[1:] - 1] = own
    end = np.cumsum(np.where(prints, stated, 1.0) * own)
    begin = np.concatenate([[0.0], end[:-1]])
    seconds = _seconds(replace(actions, begin_s=begin, end_s=end), arrivals)
    assert seconds[prints] == pytest.approx(4.0 * taken)


PARKED = (0, 2)  # the left head's last action, in `stacked_plan`


def test_a_lag_cools_what_another_head_printed(make):
    """What counts is promised by the order and its lags, whatever the timing."""
    assert verify_plan(make.stacked_plan((*PARKED, -1, 18.0))).ok
    for lag in (0.0, 10.0):
        verdict = verify_plan(make.stacked_plan((*PARKED, -1, lag)))
        assert verdict.kinds() == {FaultKind.COOLING}
        assert "after contour 0 under it, 20.0 s are due" in str(verdict.faults[0])


def test_time_that_only_the_schedule_keeps_is_none(make):
    """Line 1 takes 40 s and nominally ends long after line 0: nothing promises that it does."""
    document = make.stacked_plan(PARKED)
    left, right = document.plan.heads
    late = replace(right, begin_s=right.begin_s + 60.0, end_s=right.end_s + 60.0)
    document = replace(document, plan=replace(document.plan, heads=(left, late)))
    assert verify_plan(document).kinds() == {FaultKind.COOLING}


def test_work_between_two_waits_cools_too(make):
    """Once line 1 begins after line 0 has ended, its 40 s are enough."""
    assert verify_plan(make.stacked_plan(PARKED, first=[(0, 1)])).ok


def test_a_point_is_no_end(make):
    """Line 1 may begin before line 0 has ended; its time does not count."""
    document = make.stacked_plan(PARKED, first=[(0, 1, 7)])
    assert verify_plan(document).kinds() == {FaultKind.COOLING}


def test_two_heads_that_keep_the_source_order_owe_nothing(make):
    """Each tower is printed without a lag in the source, so none is due."""
    assert verify_plan(replace(make.two_head_plan(), min_layer_time_s=5.0)).ok


def test_a_wait_counts_in_the_replay(make, towers):
    """It lasts as long as the plan says."""
    document = with_waits(make, towers, WAIT_S)
    actions = document.plan.heads[0]
    taken = make.arrivals_of(document, actions)[actions.path_offsets[1:] - 1]
    assert taken[actions.kind == ActionKind.WAIT] == pytest.approx(WAIT_S)
