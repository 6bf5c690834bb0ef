"""Times of a plan that leave no time for what its controllers need between two actions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.print.plan import ACTION_END, ActionKind, HeadActions, JointPlan, PlanDocument
from sim.replay.nominal import check_signals, check_times
from tests.sim.conftest import two_head_machine

REST_S = 0.45
EDGE = dict[int, list[tuple[int, int, int]]]


def head(name: str, kinds: list[ActionKind], begin: list[float], after: EDGE) -> HeadActions:
    """Actions of 1 s along 30 mm; `after` has head, action and point for each that waits."""
    n = len(kinds)
    flat = [edge for k in range(n) for edge in after.get(k, [])]
    columns = np.array(flat, np.int32).reshape(-1, 3)
    path = np.zeros((4 * n, 3))
    path[:, 0] = np.tile([0.0, 1.0, 15.0, 30.0], n)
    return HeadActions(
        name, np.array(kinds, np.int8), np.full(n, -1, np.int32), np.zeros(n, np.bool_),
        np.zeros(n, np.int32), np.arange(n + 1) * 4, path, np.array(begin),
        np.array(begin) + 1.0, np.cumsum([0, *(len(after.get(k, [])) for k in range(n))]),
        columns[:, 0], columns[:, 1], columns[:, 2], np.zeros(len(flat)),
    )  # fmt: skip


def document(make, left: HeadActions, right: HeadActions, **fields) -> PlanDocument:
    plan = make.stacked_plan()
    machine = replace(two_head_machine(), **fields)
    return replace(plan, machine=machine, plan=JointPlan((left, right)))


@pytest.mark.parametrize("begin", [1.0, 1.0 + REST_S - 0.01, 1.0 + REST_S])
@pytest.mark.parametrize("point", [ACTION_END, 3])
def test_a_wait_leaves_time_to_start_again(make, begin: float, point: int):
    """From the end that is waited for, and from its own head's."""
    travel = ActionKind.TRAVEL
    left = head("left", [travel], [0.0], {})
    for kinds, begins in (([travel], [begin]), ([travel, travel], [0.0, begin])):
        right = head("right", kinds, begins, {len(kinds) - 1: [(0, 0, point)]})
        plan = document(make, left, right, rest_s=REST_S)
        assert (not check_times(plan, plan.plan.heads)) is (begin == 1.0 + REST_S)


@pytest.mark.parametrize(
    ("release", "kind", "due"),
    [
        ("action", ActionKind.TRAVEL, True),
        ("action", ActionKind.WAIT, True),
        ("point", ActionKind.TRAVEL, False),
        ("point", ActionKind.WAIT, True),
    ],
)
def test_who_signals_at_rest_starts_again_too(make, release: str, kind: ActionKind, due: bool):
    """In motion it goes on."""
    right = head("right", [ActionKind.TRAVEL], [1.0 + REST_S], {0: [(0, 0, ACTION_END)]})
    for begin in (1.0, 1.0 + REST_S):
        left = head("left", [kind, ActionKind.TRAVEL], [0.0, begin], {})
        plan = document(make, left, right, rest_s=REST_S, release=release)
        faults = check_times(plan, plan.plan.heads)
        assert bool(faults) is (due and begin == 1.0)
        assert all("takes 0.45 s to start again" in fault.text for fault in faults)


@pytest.mark.parametrize(
    ("places", "gap_s"),
    [
        ([(0, 1), (0, 2)], 14 / 30),
        ([(0, 2), (0, ACTION_END)], 0.5),
        ([(0, 3), (1, 1)], 1 / 30),
        ([(0, ACTION_END), (1, 2)], 0.5),
        ([(0, 2), (1, 1)], 16 / 30),
        ([(0, ACTION_END), (1, ACTION_END)], 1.0),
        ([(0, 1), (1, ACTION_END)], 59 / 30),
        ([(0, ACTION_END), (0, 3)], None),
    ],
)
def test_signals_nearer_than_a_controller_tells_apart_are_seen(make, places, gap_s):
    """A travel is taken to be even; two names of one place are one signal."""
    travel = ActionKind.TRAVEL
    left = head("left", [travel, travel], [0.0, 1.0], {})
    right = head("right", [travel], [9.0], {0: [(0, k, point) for k, point in places]})
    for interval_s in (0.01, 0.1, 0.47, 0.52, 0.7, 1.5, 2.0):
        options = {"release": "point", "signal_interval_s": interval_s, "rest_s": 0.0}
        plan = document(make, left, right, **options)
        near = gap_s is not None and gap_s < interval_s - 1e-3
        assert bool(check_signals(plan, plan.plan.heads)) is near, interval_s
        plan = replace(plan, machine=replace(plan.machine, release="action"))
        assert not check_signals(plan, plan.plan.heads)
