"""Whether the nominal times of a plan can be kept, and keep the order the plan itself states.

No action is shorter than its motion under the limits (`sim.replay.least`), and what the plan says
of its own times and lengths is what its actions add up to. The plan does not state when an
action passes a point. That is never sooner than if all the way to there is printed at the
source's feed, without acceleration, and never later than the action's end. These limits are
what nominal times are checked against. Where a head stops for another one, its controller takes
`rest_s` until it moves again: behind each wait, and behind each end that it signals at rest.

Signals nearer than `signal_interval_s` are lost, so who waits for them would wait longer than the
plan says. Files are judged by their own lines (`sim.heads.order`); here the plan's times are.
Along a travel, whose feed the plan does not state, a point is passed as if at a uniform speed.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.print.contours import Contours
from decmcts.print.machine import Release
from decmcts.print.plan import ACTION_END, ActionKind, After, HeadActions, PlanDocument
from sim.content.over_walls import over_walls_mm
from sim.content.paths import describe
from sim.content.pieces import is_near, is_number
from sim.faults import Fault, FaultKind, listed
from sim.replay.least import print_feed

TIME_TOLERANCE_S = 1e-3
MODEL = 0.02  # share of the least time of an action that rounded points may take off
WALLS_SHARE, WALLS_MM = 0.02, 20.0  # rounded, a travel may or may not touch the end of a wall
ROUNDING = 1e-3  # share that rounded coordinates may make a way shorter


def check_times(document: PlanDocument, all_actions: tuple[HeadActions, ...]) -> list[Fault]:
    """Check each action against the one before it and all it waits for, lags and rests included."""
    lines: list[str] = []
    rest_s = document.machine.rest_s
    stopped = _stopped(all_actions, document.machine.release)
    for h, actions in enumerate(all_actions):
        begin, end = actions.begin_s, actions.end_s
        free = np.concatenate([[0.0], end[:-1]])[: len(actions)]
        for a in np.flatnonzero(np.diff(actions.after_offsets)).tolist():
            due = (
                _passed(document.contours, all_actions, edge) + edge.lag_s
                for edge in actions.after_edges(a)
            )
            free[a] = max(free[a], *due)
        late = (end < begin) | (begin < free - TIME_TOLERANCE_S)
        lines += [
            f"{describe(actions, a)} begins before what it waits for has happened"
            for a in np.flatnonzero(late).tolist()
        ]
        soon = begin < free + rest_s - TIME_TOLERANCE_S
        lines += [
            f"{describe(actions, a)} begins {begin[a] - free[a]:.3f} s after the head could stop, "
            f"its controller takes {rest_s:g} s to start again"
            for a in np.flatnonzero(stopped[h] & soon & ~late).tolist()
        ]
    return listed(FaultKind.TIMES, lines)


def _stopped(all_actions: tuple[HeadActions, ...], release: Release) -> list[Flags]:
    """Tell of each action whether its head surely stands still, its moves run out, before it.

    It does where it waits for another head, and behind an end that another head waits for if it
    can signal that at rest only. Controllers that signal in motion stop behind a wait alone, where
    the head has not moved.
    """
    stopped = []
    for h, actions in enumerate(all_actions):
        waits = np.zeros(len(actions) + 1, np.bool_)
        owner = np.repeat(np.arange(len(actions)), np.diff(actions.after_offsets))
        waits[owner[actions.after_head != h]] = True
        action, point = _awaited(all_actions, h)
        ended = point == np.diff(actions.path_offsets)[action] - 1
        if release == "point":
            ended &= actions.kind[action] == ActionKind.WAIT
        waits[action[ended] + 1] = True
        stopped.append(waits[:-1])
    return stopped


def _awaited(all_actions: tuple[HeadActions, ...], head: int) -> tuple[Ints, Ints]:
    """Return action and point, an end as the last point, of all that others wait for of a head."""
    others = [(each, each.after_head == head) for h, each in enumerate(all_actions) if h != head]
    none = np.empty(0, np.int64)
    action = np.concatenate([none, *(each.after_action[mine] for each, mine in others)])
    point = np.concatenate([none, *(each.after_point[mine] for each, mine in others)])
    last = np.diff(all_actions[head].path_offsets)[action] - 1
    return action, np.where(point == ACTION_END, last, point)


def check_least(all_actions: tuple[HeadActions, ...], least: list[Floats]) -> list[Fault]:
    """Check that no action is shorter than its own motion (`least_arrivals` of each head)."""
    lines: list[str] = []
    for actions, passed in zip(all_actions, least, strict=True):
        due = passed[actions.path_offsets[1:] - 1] * (1.0 - MODEL) - TIME_TOLERANCE_S
        takes = actions.end_s - actions.begin_s
        lines += [
            f"{describe(actions, a)} takes {takes[a]:.3f} s, its motion at least {due[a]:.3f} s"
            for a in np.flatnonzero(takes < due).tolist()
        ]
    return listed(FaultKind.TIMES, lines)


def check_metrics(document: PlanDocument, all_actions: tuple[HeadActions, ...]) -> list[Fault]:
    """Check the figures a plan states of itself, where it does, against its actions."""
    lines, metrics = [], document.metrics
    for name, due in _figures(document, all_actions).items():
        stated, within = metrics.get(name, due), TIME_TOLERANCE_S + 1e-6 * abs(due)
        if not is_near(stated, due, within):
            lines.append(f"{name} is stated as {stated}, the actions have {due:.6g}")
    stated = metrics.get("travel_over_walls_mm")
    # of the whole file, which has more moves than the plan; of a kept source of its own travels
    if stated is not None and len(all_actions) == 1 and not metrics.get("kept_source"):
        due = over_walls_mm(document.contours, all_actions[0])
        if not is_number(stated) or not stated >= due * (1.0 - WALLS_SHARE) - WALLS_MM:
            text = f"travel_over_walls_mm is stated as {stated}, the travels have {due:.6g}"
            lines.append(text)
    return listed(FaultKind.TIMES, lines)


def _figures(document: PlanDocument, all_actions: tuple[HeadActions, ...]) -> dict[str, float]:
    """Return what the actions add up to, by the names metrics have."""
    ends = [float(actions.end_s.max(initial=0.0)) for actions in all_actions]
    makespan = max(ends, default=0.0)
    waits, rested, prints, moved, bare = 0, 0.0, 0, 0.0, 0.0
    for actions in all_actions:
        printed = np.flatnonzero(actions.kind == ActionKind.PRINT)
        goal, start = actions.path_offsets[printed[1:]], actions.path_offsets[printed[:-1] + 1] - 1
        bare += float(np.linalg.norm(actions.path[goal] - actions.path[start], axis=1).sum())
        rests = actions.kind == ActionKind.WAIT
        waits += int(rests.sum())
        rested += float((actions.end_s - actions.begin_s)[rests].sum())
        prints += len(printed)
        step = np.linalg.norm(np.diff(actions.path, axis=0, prepend=actions.path[:1]), axis=1)
        step[actions.path_offsets[:-1]] = 0.0
        lays = np.repeat(actions.kind == ActionKind.PRINT, np.diff(actions.path_offsets))
        moved += float(step[~lays].sum())
    edges = sum(len(actions.after_head) for actions in all_actions)
    return {
        "makespan_s": makespan, "waits": waits, "waits_s": rested,
        "contours": prints, "emitted_travel_mm": moved, "extrusionless_travel_mm": bare,
        "cross_head_waits": edges,
    }  # fmt: skip


def _passed(contours: Contours, all_actions: tuple[HeadActions, ...], edge: After) -> float:
    """Return the least time at which what is waited for can have happened."""
    actions = all_actions[edge.head]
    begin, end = float(actions.begin_s[edge.action]), float(actions.end_s[edge.action])
    if edge.point in (ACTION_END, len(actions.action_path(edge.action)) - 1):
        return end
    printed = _printed_s(contours, actions, edge.action)
    least = 0.0 if printed is None else float(printed[edge.point]) * (1.0 - ROUNDING)
    return min(begin + least, end)


def _printed_s(contours: Contours, actions: HeadActions, action: int) -> Floats | None:
    """Return the seconds to print to each point of an action at the source's feed, (n,).

    None of travels, and of a wrong path, which is reported elsewhere.
    """
    if actions.kind[action] != ActionKind.PRINT:
        return None
    length = np.linalg.norm(np.diff(actions.action_path(action), axis=0), axis=1)
    feed = print_feed(contours, actions, action)
    if len(feed) != len(length):
        return None
    return np.concatenate([[0.0], np.cumsum(length / np.where(feed > 0.0, feed, np.inf))])


def check_signals(document: PlanDocument, all_actions: tuple[HeadActions, ...]) -> list[Fault]:
    """Check that a head has `signal_interval_s` between any two places that others wait for."""
    machine = document.machine
    interval_s = machine.signal_interval_s if machine.release == "point" else 0.0
    if interval_s <= 0.0:
        return []
    lines = []
    for h, actions in enumerate(all_actions):
        clocks: dict[int, Floats] = {}
        asked = (column.tolist() for column in _awaited(all_actions, h))
        places = sorted(set(zip(*asked, strict=True)))
        for action, _ in places:
            if action not in clocks:
                clocks[action] = _clock(document, actions, action)
        for (k, p), (n, q) in pairwise(places):
            gap = _gap(actions, clocks, (k, p), (n, q))
            if gap < interval_s - TIME_TOLERANCE_S:
                lines.append(
                    f"{describe(actions, n)} is signalled at point {q}, {gap:.3f} s after point "
                    f"{p} of action {k}; the controller tells {interval_s:g} s apart"
                )
    return listed(FaultKind.TIMES, lines)


def _clock(document: PlanDocument, actions: HeadActions, action: int) -> Floats:
    """Return the least seconds from the begin of an action to its points, (n,)."""
    printed = _printed_s(document.contours, actions, action)
    if printed is not None:
        return printed
    steps = np.linalg.norm(np.diff(actions.action_path(action), axis=0), axis=1)
    takes = float(actions.end_s[action] - actions.begin_s[action])
    share = np.cumsum(steps) / max(float(steps.sum()), 1e-9)
    return np.concatenate([[0.0], share * takes])


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
