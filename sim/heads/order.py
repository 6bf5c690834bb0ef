"""What the sync points of all heads' files order, held against the plan.

A sync point signals a number, or waits for one. Every edge of the plan must be kept by a wait
for a number that is signalled no sooner than the edge asks: at the end of an action, or at a
point within one. Numbers are used for nothing else, no head stops within an action, and all
files taken together never deadlock.

A head's signals must be as far apart in time as its controller can tell them apart: Klipper drops
changes of an output nearer than 0.1 s, so of two such signals none may come. Times are the least
that the lines of a file can take: their moves at the feeds they name, without acceleration, and
what they dwell. A wait takes as long as it takes, at least none.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from decmcts.print.machine import Release
from decmcts.print.plan import ACTION_END, ActionKind, After, HeadActions, JointPlan
from sim.arrays import Floats
from sim.faults import Fault, FaultKind, listed
from sim.heads.file import FileWaits, HeadFile
from sim.heads.sync import Knowledge, Sync
from sim.heads.walk import Walk

ROUNDING_S = 1e-4
SPARE, SPARE_S = 0.1, 0.01  # by which a writer may put signals further apart
LAG_TOLERANCE_S = 1e-3  # files say milliseconds
SyncWindow = tuple[list[int], list[int]]  # lines between which the sync points of actions stand


@dataclass(frozen=True, slots=True)
class FileParts:
    """The parts of one head's file, by line from 1."""

    first: int  # first command
    parked: int  # the head has reached its park position
    end_code: int  # the first line of the end code; below all lines where it has none
    begin: int  # first move of the body
    end: int  # past its last move
    blocks: tuple[tuple[int, ...], ...] = ()  # lines of each block, none where it has no command


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
    files: Sequence[HeadFile], plan: JointPlan, known: Knowledge, parts: list[FileParts],
    walks: list[Walk], intervals: Intervals, *, read: bool = False,
) -> list[Fault]:  # fmt: skip
    """Check that the files order what the plan orders, and keep set-up first and end code last.

    With `read` the plan was read from the files. It then has no edge for what a head knows
    already, so waits without an edge of the plan are no faults. A signal may be given later than at
    its point where another is nearer than `intervals` allow. Each edge, wait and dwell costs
    O(log n), whatever else the files hold.
    """
    lines = []
    heads = range(len(files))
    firsts = [next((line for line in walks[h].first if line > 0), parts[h].end_code) for h in heads]
    lasts = [max(walks[h].last, default=parts[h].parked) for h in heads]
    windows = [
        ([part.parked, *walk.last], walk.ahead(part.end_code))
        for part, walk in zip(parts, walks, strict=True)
    ]
    given = {s.number: (g, s) for g, file in enumerate(files) for s in file.syncs if s.signal}
    for h in heads:
        name = plan.heads[h].head
        for g in heads:
            if g == h:
                continue
            other = plan.heads[g].head
            if g < h and known.done(h, parts[h].first, g) <= parts[g].parked:
                lines.append(f"head {name} sets up before head {other} is parked")
            if known.done(h, firsts[h], g) <= parts[g].parked:
                lines.append(f"head {name} begins before head {other} is parked")
            if known.done(h, parts[h].end_code, g) <= lasts[g]:
                lines.append(f"head {name} ends before head {other} has printed all it has to")
            if g == h - 1 and known.done(h, parts[h].end_code, g) < _last_end(files[g], parts[g]):
                lines.append(f"the end codes of heads {other} and {name} may run at once")
        lines += _in_motion(files[h], given, firsts, lasts, h, name)
        begins = walks[h].ahead(0)
        lines += _unkept(files[h].rests, begins, plan, known, walks, h)
        lines += _unrested(files[h].rests, begins, plan, known, walks, h)
        lines += _stops(files[h], plan.heads[h], walks[h])
        if not read:
            lines += _unplanned(files, plan, parts, walks, h, given, windows, firsts, intervals)
    return listed(FaultKind.PRECEDENCE, lines)


def _in_motion(
    file: HeadFile, given: Mapping[int, tuple[int, Sync]], firsts: list[int], lasts: list[int],
    h: int, name: str,
) -> list[str]:  # fmt: skip
    """Return the signals of one head's set-up, and those its end waits for, that are in motion.

    What has been set up or switched off is no move, so it may come later than the last one.
    """
    early = [s.line for s in file.syncs if s.moving and s.line < firsts[h]]
    behind = [s for s in file.syncs if not s.signal and s.line > lasts[h]]
    late = [s for s in behind if given[s.number][1].moving]
    return [f"head {name} line {line} signals its set-up, and not at rest" for line in early] + [
        f"head {name} line {s.line} waits behind its print for a signal not given at rest"
        for s in late
    ]


def _last_end(file: HeadFile, part: FileParts) -> int:
    """Return the last line of a head's end code; 0 where it has none."""
    return file.rest[-1][0] if file.rest and part.end_code <= len(file.lines) else 0


def _unkept(
    rests: FileWaits,
    begins: list[int],
    plan: JointPlan,
    known: Knowledge,
    walks: list[Walk],
    h: int,
) -> list[str]:
    """Return the edges into one head that its waits, or the dwells behind them, do not keep."""
    actions, lines = plan.heads[h], []
    beyond = walks[h].last[-1] if walks[h].last else 0
    for k in np.flatnonzero(np.diff(actions.after_offsets)).tolist():
        first = begins[k] or beyond + 1
        for edge in actions.after_edges(k):
            g, reached = edge.head, _reached(walks[edge.head], edge)
            if g == h:
                continue
            what = f"action {edge.action} of head {plan.heads[g].head}"
            if edge.point != ACTION_END:
                what = f"point {edge.point} of {what}"
            if known.done(h, first, g) <= reached:
                lines.append(f"head {actions.head} action {k} does not wait for {what}")
            elif edge.lag_s > _dwelt(rests, known, h, g, reached, first) + LAG_TOLERANCE_S:
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


def _dwelt(rests: FileWaits, known: Knowledge, h: int, g: int, reached: int, first: int) -> float:
    """Return the seconds head h dwells between knowing that g has `reached` a line and `first`.

    What a head knows never grows less, so the wait behind which it knows is found by bisection.
    """
    row = bisect_right(rests.waits, reached, key=lambda at: known.done(h, at + 1, g))
    wait = rests.waits[row] if row < len(rests.waits) else first
    return rests.between_s(wait, first)


def _unrested(
    rests: FileWaits,
    begins: list[int],
    plan: JointPlan,
    known: Knowledge,
    walks: list[Walk],
    h: int,
) -> list[str]:
    """Return the waits of one head for which its file does not dwell as long as planned."""
    actions, walk, lines = plan.heads[h], walks[h], []
    for k in np.flatnonzero(actions.kind == ActionKind.WAIT).tolist():
        first = begins[k] or walk.last[k] + 1
        edges = [edge for edge in actions.after_edges(k) if edge.head != h]
        due = float(actions.end_s[k] - actions.begin_s[k])
        due += max((edge.lag_s for edge in edges), default=0.0)
        dwelt = [
            _dwelt(rests, known, h, edge.head, _reached(walks[edge.head], edge), first)
            for edge in edges
        ]
        dwelt.append(rests.between_s(walk.last[k], first))
        if min(dwelt) < due - LAG_TOLERANCE_S:
            lines.append(
                f"head {actions.head} dwells {min(dwelt):.1f} s for action {k}, planned {due:.1f} s"
            )
    return lines


def _stops(file: HeadFile, actions: HeadActions, walk: Walk) -> list[str]:
    """Return the lines that make a head stand still within an action."""
    lines = file.rests.dwells + [sync.line for sync in file.syncs if not sync.moving]
    return [
        f"head {actions.head} line {line} stops the head within action {k}"
        for line in lines
        for k in [bisect_right(walk.last, line)]
        if k < len(walk.first) and 0 < walk.first[k] < line
    ]


def _unplanned(
    files: Sequence[HeadFile], plan: JointPlan, parts: list[FileParts], walks: list[Walk], h: int,
    given: Mapping[int, tuple[int, Sync]], windows: list[SyncWindow], firsts: list[int],
    intervals: Intervals,
) -> list[str]:  # fmt: skip
    """Return the waits of one head's body that stand for no edge of the plan.

    `given` has the signal of each number with its head, `firsts` where each head's moves begin.
    """
    low, high = windows[h]
    lines, ends = [], max(walks[h].last, default=0)
    for sync in files[h].syncs:
        if sync.signal or not parts[h].parked < sync.line < ends:
            continue
        g, signal = given[sync.number]
        line = signal.line
        other_low, other_high = windows[g]
        actions = range(bisect_right(high, sync.line), bisect_left(low, sync.line))
        ended = range(bisect_right(other_high, line) - 1, bisect_left(other_low, line) - 1)
        signalled = {(a, ACTION_END) for a in ended}
        signalled |= _passed(walks[g], line) if signal.moving else set()
        edges = [e for k in actions for e in plan.heads[h].after_edges(k) if e.head == g]
        meant = {(e.action, ACTION_END if _is_end(plan, e) else e.point) for e in edges}
        if (signal.moving or line >= firsts[g]) and not signalled & meant:
            acts = {action for action, _ in signalled}
            places = [_reached(walks[g], edge) for edge in edges if edge.action in acts]
            if any(intervals.excuse(g, place, line) for place in places):
                continue
            lines.append(f"head {plan.heads[h].head} line {sync.line} waits where no plan does")
    return lines


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


def last_points(plan: JointPlan, head: int) -> dict[int, int]:
    """Return the last point, before the end, of a head's actions that others wait for."""
    last = np.diff(plan.heads[head].path_offsets) - 1
    found = np.full(len(last), -1)
    for actions in plan.heads:
        rows = np.flatnonzero((actions.after_head == head) & (actions.after_point != ACTION_END))
        action, point = actions.after_action[rows], actions.after_point[rows]
        within = point != last[action]
        np.maximum.at(found, action[within], point[within])
    waited = np.flatnonzero(found >= 0)
    return dict(zip(waited.tolist(), found[waited].tolist(), strict=True))


def least_clock(file: HeadFile) -> Floats:
    """Return the least seconds from the begin of a file to each of its lines, (lines + 2,)."""
    motion = file.motion
    clock = np.zeros(len(file.lines) + 2)  # clock[k]: all lines above k, from 1, have been run
    length = np.linalg.norm(np.diff(motion.points, axis=0), axis=1)
    moving = (length > 0.0) & (motion.feed > 0.0)
    seconds = length[moving] / motion.feed[moving]
    np.add.at(clock, motion.line[moving] + 2, seconds)
    clock[np.array(file.rests.dwells, np.int64) + 1] += np.diff(file.rests.total_ms) / 1000.0
    return np.asarray(np.cumsum(clock))


class Intervals:
    """The least times of all files, and what an interval excuses."""

    def __init__(self, files: Sequence[HeadFile], interval_s: float) -> None:
        self._files, self._interval_s = files, interval_s
        self._near_s = interval_s * (1.0 + SPARE) + SPARE_S if interval_s > 0.0 else 0.0
        self._clocks = [least_clock(file) for file in files] if interval_s > 0.0 else []

    def check(self) -> list[Fault]:
        """Check that each head leaves so many seconds between two of its signals."""
        lines = [
            f"{Path(file.path).name} line {later} signals {clock[later] - clock[line]:.3f} s after "
            f"line {line}, the machine's controllers tell {self._interval_s:g} s apart"
            for file, clock in zip(self._files, self._clocks, strict=False)
            for line, later in pairwise(file.rests.signals)
            if clock[later] - clock[line] < self._interval_s - ROUNDING_S
        ]
        return listed(FaultKind.COMMAND, lines)

    def excuse(self, head: int, reached: int, line: int) -> bool:
        """Tell whether what a head reached in a line may be signalled in a later one for this.

        That is where another signal would be too near: the later one itself, or the one before.
        """
        if self._near_s <= 0.0 or line <= reached:
            return False
        clock, given = self._clocks[head], self._files[head].rests.signals
        k = bisect_left(given, line)
        passed = clock[reached + 1]
        behind = k > 0 and passed - clock[given[k - 1]] < self._near_s
        return bool(clock[line] - passed < self._near_s or behind)
