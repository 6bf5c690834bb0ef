"""Whether the nominal times of a plan keep the order the plan itself states.

The plan does not state when an action passes a point. That is never sooner than if all the
way to there is printed at the source's feed, without acceleration, and never later than the
action's end. These limits are what nominal times are checked against.
"""

from __future__ import annotations

import numpy as np

from decmcts.print.contours import Contours
from decmcts.print.plan import ACTION_END, ActionKind, After, HeadActions
from sim.content.paths import describe
from sim.faults import Fault, FaultKind, listed
from sim.replay.execution import print_feed

TIME_TOLERANCE_S = 1e-3
ROUNDING = 1e-3  # share that rounded coordinates may make a way shorter


def check_times(contours: Contours, all_actions: tuple[HeadActions, ...]) -> list[Fault]:
    """Check each action against the one before it and all it waits for, lags included."""
    lines: list[str] = []
    for actions in all_actions:
        begin, end = actions.begin_s, actions.end_s
        own = np.concatenate([[True], begin[1:] >= end[:-1] - TIME_TOLERANCE_S])[: len(actions)]
        kept = (end >= begin) & own
        for a in np.flatnonzero(np.diff(actions.after_offsets)).tolist():
            due = max(
                _passed(contours, all_actions, edge) + edge.lag_s for edge in actions.after_edges(a)
            )
            kept[a] &= begin[a] >= due - TIME_TOLERANCE_S
        lines += [
            f"{describe(actions, a)} begins before what it waits for has happened"
            for a in np.nonzero(~kept)[0].tolist()
        ]
    return listed(FaultKind.TIMES, lines)


def _passed(contours: Contours, all_actions: tuple[HeadActions, ...], edge: After) -> float:
    """Return the least time at which what is waited for can have happened."""
    actions = all_actions[edge.head]
    begin, end = float(actions.begin_s[edge.action]), float(actions.end_s[edge.action])
    if edge.point == ACTION_END:
        return end
    return min(begin + _least_seconds(contours, actions, edge.action, edge.point), end)


def _least_seconds(contours: Contours, actions: HeadActions, action: int, point: int) -> float:
    """Return what printing to a point of an action takes at least; 0 of travels."""
    if actions.kind[action] != ActionKind.PRINT:
        return 0.0
    path, feed = actions.action_path(action), print_feed(contours, actions, action)
    if len(feed) != len(path) - 1:
        return 0.0  # a wrong path is reported elsewhere
    length = np.linalg.norm(np.diff(path, axis=0), axis=1)[:point]
    moving = feed[:point] > 0.0
    return float((length[moving] / feed[:point][moving]).sum()) * (1.0 - ROUNDING)
