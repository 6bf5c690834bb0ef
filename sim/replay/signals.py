"""Whether the signals a plan asks of each head are as far apart as its controller needs.

Signals nearer than `signal_interval_s` are lost, so who waits for them would wait longer than the
plan says. Files are judged by their own lines (`sim.heads.intervals`); here the plan's times are.
Within an action a point is passed as if all is printed at the contour's feed, which is the
soonest; along a travel, whose feed the plan does not state, at a uniform speed.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from decmcts.print.plan import ACTION_END, ActionKind, HeadActions, PlanDocument
from sim.arrays import Floats
from sim.content.paths import describe
from sim.faults import Fault, FaultKind, listed
from sim.replay.execution import print_feed

TOLERANCE_S = 1e-3


def check_signals(document: PlanDocument, all_actions: tuple[HeadActions, ...]) -> list[Fault]:
    """Check that a head has `signal_interval_s` between any two places that others wait for."""
    machine = document.machine
    interval_s = machine.signal_interval_s if machine.release == "point" else 0.0
    if interval_s <= 0.0:
        return []
    lines = []
    for h, actions in enumerate(all_actions):
        clocks: dict[int, Floats] = {}
        places = sorted(_asked(all_actions, h))
        for action, _ in places:
            if action not in clocks:
                clocks[action] = _clock(document, actions, action)
        for (k, p), (n, q) in pairwise(places):
            gap = _gap(actions, clocks, (k, p), (n, q))
            if gap < interval_s - TOLERANCE_S:
                lines.append(
                    f"{describe(actions, n)} is signalled at point {q}, {gap:.3f} s after point "
                    f"{p} of action {k}; the controller tells {interval_s:g} s apart"
                )
    return listed(FaultKind.TIMES, lines)


def _asked(all_actions: tuple[HeadActions, ...], head: int) -> set[tuple[int, int]]:
    """Return action and point, an end as the last point, of all that others wait for of a head."""
    sizes = np.diff(all_actions[head].path_offsets)
    found = set()
    for h, actions in enumerate(all_actions):
        if h == head:
            continue
        mine = actions.after_head == head
        action, point = actions.after_action[mine], actions.after_point[mine]
        last = sizes[action] - 1
        point = np.where(point == ACTION_END, last, point)
        found |= set(zip(action.tolist(), point.tolist(), strict=True))
    return found


def _clock(document: PlanDocument, actions: HeadActions, action: int) -> Floats:
    """Return the least seconds from the begin of an action to its points, (n,)."""
    path = actions.action_path(action)
    length = np.linalg.norm(np.diff(path, axis=0), axis=1)
    takes = float(actions.end_s[action] - actions.begin_s[action])
    if actions.kind[action] == ActionKind.PRINT:
        feed = print_feed(document.contours, actions, action)
        if len(feed) == len(length):  # a wrong path is reported elsewhere
            return np.concatenate([[0.0], np.cumsum(length / np.where(feed > 0.0, feed, np.inf))])
    whole = max(float(length.sum()), 1e-9)
    return np.concatenate([[0.0], np.cumsum(length) / whole * takes])


def _gap(
    actions: HeadActions, clocks: dict[int, Floats], first: tuple[int, int], next_: tuple[int, int]
) -> float:
    """Return the least seconds between two places of a head, by the plan's times."""
    (k, p), (n, q) = first, next_
    if k == n:
        return float(clocks[k][q] - clocks[k][p])
    left = float(clocks[k][-1] - clocks[k][p])
    if q == len(clocks[n]) - 1:
        return left + float(actions.end_s[n] - actions.end_s[k])
    return left + float(actions.begin_s[n] - actions.end_s[k]) + float(clocks[n][q])
