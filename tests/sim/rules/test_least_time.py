"""The least time between legs, against all ways through the order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim.content.paths import legs_of
from sim.rules.cooling import LeastTime
from sim.rules.order import order_of


def longest(all_actions, seconds, start, goal):
    """Return the longest way from the end of `start` to the begin of `goal`, or None."""
    ways = [
        (edge.head, edge.action, edge.lag_s) for edge in all_actions[goal[0]].after_edges(goal[1])
    ] + ([(goal[0], goal[1] - 1, 0.0)] if goal[1] else [])
    found = []
    for head, leg, lag_s in ways:
        if (head, leg) == start:
            found.append(lag_s)
        before = longest(all_actions, seconds, start, (head, leg))
        if before is not None:
            found.append(before + seconds[head][leg] + lag_s)
    return max(found, default=None)


@pytest.mark.parametrize("seed", range(12))
def test_least_time_is_the_longest_way(make, seed):
    """Every leg nearer than the limit is found, with its time; those farther are not."""
    rng = np.random.default_rng(seed)
    all_actions = tuple(
        replace(actions, after_lag_s=rng.choice([0.0, 1.5], len(actions.after_head)))
        for actions in make.actions_with_points(rng)
    )
    legs = legs_of(all_actions)
    seconds = [rng.choice([0.0, 0.5, 1.0], len(actions)) for actions in legs.all_actions]
    time, limit = LeastTime(legs, order_of(legs.all_actions), seconds), 2.25
    every = [(h, k) for h, actions in enumerate(legs.all_actions) for k in range(len(actions))]
    for goal in every:
        due = {start: longest(legs.all_actions, seconds, start, goal) for start in every}
        near = {at: gap for at, gap in due.items() if gap is not None and gap < limit}
        found = {(h, k): gap for h, k, gap in time.since(*goal, limit)}
        assert found == pytest.approx(near)


def test_a_leg_is_found_once_and_alone(make):
    """With nothing before it, nothing has ended."""
    legs = legs_of(make.actions_with_points(np.random.default_rng(0)))
    order = order_of(legs.all_actions)
    time = LeastTime(legs, order, [np.ones(len(actions)) for actions in legs.all_actions])
    head, leg = order.sequence[0].tolist()
    assert list(time.since(head, leg, 99.0)) == []
