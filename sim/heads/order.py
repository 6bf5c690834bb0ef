"""What the sync points of all heads' files order, held against the plan.

A sync point signals a number, or waits for one. Every edge of the plan must be kept by a wait
for a number that is signalled no sooner than the edge asks: at the end of an action, or at a
point within one. Numbers are used for nothing else, no head stops within an action, and all
files taken together never deadlock.
"""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from decmcts.print.machine import Release
from decmcts.print.plan import ACTION_END, ActionKind, After, HeadActions, JointPlan
from sim.faults import Fault, FaultKind, listed
from sim.heads.file import HeadFile
from sim.heads.sync import Knowledge
from sim.heads.walk import Walk

LAG_TOLERANCE_S = 1e-3  # files say milliseconds
_DWELL = re.compile(rb"G4 P(\d+)\Z")


@dataclass(frozen=True, slots=True)
class Parts:
    """The parts of one head's file, by line from 1."""

    first: int  # first command
    parked: int  # the head has reached its park position
    end_code: int  # the first line of the end code; below all lines where it has none
    begin: int  # first move of the body
    end: int  # past its last move


def check_sync(files: Sequence[HeadFile], known: Knowledge, release: Release) -> list[Fault]:
    """Check that every number is signalled once and waited for, and that no file waits for ever."""
    lines = [f"{Path(files[h].path).name} line {line} waits for ever" for h, line in known.stuck]
    moving = [
        f"{Path(file.path).name} line {sync.line} signals in motion, which the machine's "
        "controllers cannot"
        for file in files
        for sync in file.syncs
        if sync.moving and release == "action"
    ]
    return (
        listed(FaultKind.COMMAND, moving)
        + listed(FaultKind.DEADLOCK, lines)
        + listed(FaultKind.PRECEDENCE, known.faults)
    )


def check_order(
    files: Sequence[HeadFile], plan: JointPlan, known: Knowledge, parts: list[Parts],
    walks: list[Walk], *, read: bool = False,
) -> list[Fault]:  # fmt: skip
    """Check that the files order what the plan orders, and keep set-up first and end code last.

    With `read` the plan was read from the files. It then has no edge for what a head knows
    already, so waits without an edge of the plan are no faults.
    """
    lines = []
    heads = range(len(files))
    for h in heads:
        name = plan.heads[h].head
        first = next((line for line in walks[h].first if line > 0), parts[h].end_code)
        for g in heads:
            if g == h:
                continue
            other = plan.heads[g].head
            if g < h and known.done(h, parts[h].first, g) <= parts[g].parked:
                lines.append(f"head {name} sets up before head {other} is parked")
            if known.done(h, first, g) <= parts[g].parked:
                lines.append(f"head {name} begins before head {other} is parked")
            ended = max(walks[g].last, default=parts[g].parked)
            if known.done(h, parts[h].end_code, g) <= ended:
                lines.append(f"head {name} ends before head {other} has printed all it has to")
            if g == h - 1 and known.done(h, parts[h].end_code, g) < _last_end(files[g], parts[g]):
                lines.append(f"the end codes of heads {other} and {name} may run at once")
        lines += _unkept(files, plan, known, walks, h)
        lines += _unrested(files[h], plan, known, walks, h)
        lines += _stops(files[h], plan.heads[h], walks[h])
        lines += [] if read else _unplanned(files, plan, parts, walks, h)
    return listed(FaultKind.PRECEDENCE, lines)


def _last_end(file: HeadFile, part: Parts) -> int:
    """Return the last line of a head's end code; 0 where it has none."""
    return file.rest[-1][0] if file.rest and part.end_code <= len(file.lines) else 0


def _unkept(
    files: Sequence[HeadFile], plan: JointPlan, known: Knowledge, walks: list[Walk], h: int
) -> list[str]:
    """Return the edges into one head that its waits, or the dwells behind them, do not keep."""
    actions, lines = plan.heads[h], []
    beyond = walks[h].last[-1] if walks[h].last else 0
    for k in range(len(actions)):
        first = next((line for line in walks[h].first[k:] if line > 0), beyond + 1)
        for edge in actions.after_edges(k):
            g, reached = edge.head, _reached(walks[edge.head], edge)
            if g == h:
                continue
            what = f"action {edge.action} of head {plan.heads[g].head}"
            if edge.point != ACTION_END:
                what = f"point {edge.point} of {what}"
            if known.done(h, first, g) <= reached:
                lines.append(f"head {actions.head} action {k} does not wait for {what}")
            elif edge.lag_s > _dwelt(files[h], known, h, g, reached, first) + LAG_TOLERANCE_S:
                lines.append(
                    f"head {actions.head} action {k} does not dwell for {edge.lag_s:g} s "
                    f"after {what}"
                )
    return lines


def _reached(walk: Walk, edge: After) -> int:
    """Return the line of the move that ends at the point an edge waits for."""
    return (
        walk.last[edge.action]
        if edge.point == ACTION_END
        else walk.reached[edge.action][edge.point]
    )


def _dwelt(file: HeadFile, known: Knowledge, h: int, g: int, reached: int, first: int) -> float:
    """Return the seconds head h dwells between knowing that g has `reached` a line and `first`."""
    waits = [sync.line for sync in file.syncs if not sync.signal]
    heard = next((at for at in waits if known.done(h, at + 1, g) > reached), first)
    return sum(seconds for line, seconds in _dwells(file) if heard < line < first)


def _unrested(
    file: HeadFile, plan: JointPlan, known: Knowledge, walks: list[Walk], h: int
) -> list[str]:
    """Return the waits of one head for which its file does not dwell as long as planned."""
    actions, walk, lines = plan.heads[h], walks[h], []
    for k in np.flatnonzero(actions.kind == ActionKind.WAIT).tolist():
        first = next((line for line in walk.first[k:] if line > 0), walk.last[k] + 1)
        edges = [edge for edge in actions.after_edges(k) if edge.head != h]
        due = float(actions.end_s[k] - actions.begin_s[k])
        due += max((edge.lag_s for edge in edges), default=0.0)
        dwelt = [
            _dwelt(file, known, h, edge.head, _reached(walks[edge.head], edge), first)
            for edge in edges
        ]
        dwelt.append(sum(s for line, s in _dwells(file) if walk.last[k] < line < first))
        if min(dwelt) < due - LAG_TOLERANCE_S:
            lines.append(
                f"head {actions.head} dwells {min(dwelt):.1f} s for action {k}, planned {due:.1f} s"
            )
    return lines


def _dwells(file: HeadFile) -> list[tuple[int, float]]:
    """Return line and seconds of every G4."""
    found = ((line, _DWELL.match(code)) for line, code in file.rest)
    return [(line, int(match[1]) / 1000.0) for line, match in found if match is not None]


def _stops(file: HeadFile, actions: HeadActions, walk: Walk) -> list[str]:
    """Return the lines that make a head stand still within an action."""
    lines = [line for line, _ in _dwells(file)]
    lines += [sync.line for sync in file.syncs if not sync.moving]
    return [
        f"head {actions.head} line {line} stops the head within action {k}"
        for line in lines
        for k in [bisect_right(walk.last, line)]
        if k < len(walk.first) and 0 < walk.first[k] < line
    ]


def _unplanned(
    files: Sequence[HeadFile], plan: JointPlan, parts: list[Parts], walks: list[Walk], h: int
) -> list[str]:
    """Return the waits of one head's body that stand for no edge of the plan."""
    given = {s.number: (g, s) for g, file in enumerate(files) for s in file.syncs if s.signal}
    low, high = _windows(walks[h], parts[h])
    lines = []
    for sync in files[h].syncs:
        if sync.signal or not parts[h].parked < sync.line < max(walks[h].last, default=0):
            continue
        g, signal = given[sync.number]
        line = signal.line
        other_low, other_high = _windows(walks[g], parts[g])
        actions = range(bisect_right(high, sync.line), bisect_left(low, sync.line))
        ended = range(bisect_right(other_high, line) - 1, bisect_left(other_low, line) - 1)
        told = _passed(walks[g], line) if signal.moving else {(a, ACTION_END) for a in ended}
        meant = {
            (edge.action, ACTION_END if _is_end(plan, edge) else edge.point)
            for k in actions
            for edge in plan.heads[h].after_edges(k)
            if edge.head == g
        }
        set_up = line < next((f for f in walks[g].first if f > 0), parts[g].end_code)
        if (signal.moving or not set_up) and not told & meant:
            lines.append(f"head {plan.heads[h].head} line {sync.line} waits where no plan does")
    return lines


def _windows(walk: Walk, part: Parts) -> tuple[list[int], list[int]]:
    """Return the lines between which the sync points before each action, and at the end, stand."""
    low = [part.parked, *walk.last]
    high = [part.end_code] * (len(walk.first) + 1)
    for k in range(len(walk.first) - 1, -1, -1):
        high[k] = walk.first[k] if walk.first[k] > 0 else high[k + 1]
    return low, high


def _passed(walk: Walk, line: int) -> set[tuple[int, int]]:
    """Return the points of an action that a head came to last above a line."""
    k = bisect_right(walk.last, line)
    if k >= len(walk.reached):
        return set()
    latest = max((at for at in walk.reached[k][1:] if at < line), default=0)
    return {(k, point) for point, at in enumerate(walk.reached[k]) if point and at == latest}


def _is_end(plan: JointPlan, edge: After) -> bool:
    """Tell whether what is waited for is the end of an action, its last point included."""
    path = plan.heads[edge.head].action_path(edge.action)
    return edge.point in (ACTION_END, len(path) - 1)


def last_points(plan: JointPlan) -> list[dict[int, int]]:
    """Return for each head the last point, before the end, that another waits for, by action."""
    found: list[dict[int, int]] = [{} for _ in plan.heads]
    for actions in plan.heads:
        for k in np.flatnonzero(np.diff(actions.after_offsets)).tolist():
            for edge in actions.after_edges(k):
                if not _is_end(plan, edge):
                    points = found[edge.head]
                    points[edge.action] = max(points.get(edge.action, 0), edge.point)
    return found
