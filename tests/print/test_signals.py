"""Which places heads signal, and where they stand still for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.print.job import PrintJob, ProcessSettings
from decmcts.print.plan import ACTION_END, ActionKind, JointPlan
from decmcts.print.signals import place_of, places_of, signals_of
from tests.sim.replay.test_nominal import head
from tests.team.conftest import make_contours

TRAVEL, WAIT = ActionKind.TRAVEL, ActionKind.WAIT


@pytest.fixture
def job() -> PrintJob:
    """Travels run at 30 mm/s, so each of 30 mm takes a second."""
    return PrintJob("none", make_contours([], []), ProcessSettings(travel_feed=30.0))


def plan_of(places: list[tuple[int, int]], kinds: list[ActionKind]) -> JointPlan:
    """The right head waits for these places of the left one, which has actions of 1 s."""
    left = head("left", kinds, [float(k) for k in range(len(kinds))], {})
    right = head("right", [TRAVEL], [9.0], {0: [(0, k, point) for k, point in places]})
    return JointPlan((left, right))


def test_ends_are_signalled_at_rest_where_controllers_cannot_in_motion(job):
    """Where they can, only behind what is no move."""
    plan = plan_of([(0, ACTION_END), (1, ACTION_END), (2, ACTION_END)], [TRAVEL, WAIT, TRAVEL])
    signals = signals_of(plan, job, 0.0)
    assert signals.at_rest(plan, "action") == {(0, 0), (0, 1), (0, 2)}
    assert signals.at_rest(plan, "point") == {(0, 1)}
    left = plan.heads[0]
    path = np.where(np.arange(12)[:, None] < 8, left.path, left.path[8])
    still = JointPlan((replace(left, path=path), plan.heads[1]))
    assert signals.at_rest(still, "point") == {(0, 1), (0, 2)}


@pytest.mark.parametrize(
    ("interval_s", "targets"),
    [
        (0.03, [(0, 1), (0, 2), (0, ACTION_END), (1, 2)]),
        (0.48, [(0, 2), (0, 2), (0, ACTION_END), (1, 2)]),
        (0.6, [(0, ACTION_END)] * 3 + [(1, ACTION_END)]),
        (1.5, [(0, ACTION_END)] * 3 + [(1, ACTION_END)]),
    ],
)
def test_of_signals_too_near_the_later_of_the_action_is_given(job, interval_s, targets):
    """An end never is another action's: who waits for it would wait for what may wait for it."""
    places = [(0, 1), (0, 2), (0, ACTION_END), (1, 2)]
    plan = plan_of(places, [TRAVEL, TRAVEL])
    signals = signals_of(plan, job, interval_s)
    assert [signals.at[0, *place] for place in places] == [(0, *target) for target in targets]
    assert ((0, 1) in signals.apart) is (interval_s > 1.0)


def test_places_of_all_edges_are_those_of_each(job):
    """An action's last point is its end, by whichever name it is waited for."""
    last = len(plan_of([], [TRAVEL]).heads[0].path) - 1
    plan = plan_of([(0, 1), (0, last), (1, ACTION_END)], [TRAVEL, TRAVEL])
    right = plan.heads[1]
    assert places_of(plan, right) == [place_of(plan, edge) for edge in right.after_edges(0)]
    assert places_of(plan, right)[1:] == [(0, 0, ACTION_END), (0, 1, ACTION_END)]
