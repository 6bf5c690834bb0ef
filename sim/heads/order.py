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
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from decmcts.arrays import Floats
from decmcts.print.machine import Release
from decmcts.print.plan import ACTION_END, ActionKind, After, JointPlan
from sim.faults import Fault, FaultKind, listed
from sim.heads.file import HeadFile
from sim.heads.one_file import Walked
from sim.heads.sync import Knowledge, Sync

ROUNDING_S = 1e-4
SPARE, SPARE_S = 0.1, 0.01  # by which a writer may put signals further apart
LAG_TOLERANCE_S = 1e-3  # files say milliseconds


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
    walked: Sequence[Walked], plan: JointPlan, known: Knowledge, intervals: Intervals, *,
    read: bool = False,
) -> list[Fault]:  # fmt: skip
    """Check that the files order what the plan orders, and keep set-up first and end code last.

    With `read` the plan was read from the files. It then has no edge for what a head knows
    already, so waits without an edge of the plan are no faults. A signal may be given later than at
    its point where another is nearer than `intervals` allow. Each edge, wait and dwell costs
    O(log n), whatever else the files hold.
    """
    order, lines = _Order(walked, plan, known, intervals), list[str]()
    for h in range(len(walked)):
        lines += [
            *order.ends_too_soon(h), *order.in_motion(h), *order.unkept(h), *order.unrested(h),
            *order.stops(h),
        ]  # fmt: skip
        if not read:
            lines += order.unplanned(h)
    return listed(FaultKind.PRECEDENCE, lines)


class _Order:
    """The files of all heads and what they order; says of head h what is wrong, line by line."""

    def __init__(
        self, walked: Sequence[Walked], plan: JointPlan, known: Knowledge, intervals: Intervals
    ) -> None:
        self.heads, self.known, self.intervals = plan.heads, known, intervals
        self.names = [actions.head for actions in plan.heads]
        self.files = [each.file for each in walked]
        self.parts, self.walks = [each.part for each in walked], [each.walk for each in walked]
        pairs = list(zip(self.parts, self.walks, strict=True))
        self.firsts = [
            next((line for line in walk.first if line > 0), part.end_code) for part, walk in pairs
        ]
        self.lasts = [max(walk.last, default=part.parked) for part, walk in pairs]
        # of each head the lines between which the sync points of its actions stand
        self.windows = [
            ([part.parked, *walk.last], walk.ahead(part.end_code)) for part, walk in pairs
        ]
        self.begins = [walk.ahead(0) for walk in self.walks]
        self.given = {  # the signal of each number, with its head
            sync.number: (g, sync)
            for g, file in enumerate(self.files)
            for sync in file.syncs
            if sync.signal
        }

    def ends_too_soon(self, h: int) -> Iterator[str]:
        """Yield whose set-up or print is not over where this head's set-up, print or end begins."""
        part, name = self.parts[h], self.names[h]
        for g, other in enumerate(self.names):
            if g == h:
                continue
            parked = self.parts[g].parked
            if g < h and self.known.done(h, part.first, g) <= parked:
                yield f"head {name} sets up before head {other} is parked"
            if self.known.done(h, self.firsts[h], g) <= parked:
                yield f"head {name} begins before head {other} is parked"
            done = self.known.done(h, part.end_code, g)
            if done <= self.lasts[g]:
                yield f"head {name} ends before head {other} has printed all it has to"
            file = self.files[g]
            has_end = file.rest and self.parts[g].end_code <= len(file.lines)
            if g == h - 1 and has_end and done < file.rest[-1][0]:
                yield f"the end codes of heads {other} and {name} may run at once"

    def in_motion(self, h: int) -> Iterator[str]:
        """Yield the signals of one head's set-up, and those its end waits for, that are in motion.

        What has been set up or switched off is no move, so it may come later than the last one.
        """
        syncs, name = self.files[h].syncs, self.names[h]
        for sync in syncs:
            if sync.moving and sync.line < self.firsts[h]:
                yield f"head {name} line {sync.line} signals its set-up, and not at rest"
        for sync in syncs:
            behind = not sync.signal and sync.line > self.lasts[h]
            if behind and self.given[sync.number][1].moving:
                yield (
                    f"head {name} line {sync.line} waits behind its print for a signal not given "
                    "at rest"
                )

    def unkept(self, h: int) -> Iterator[str]:
        """Yield the edges into one head that its waits, or the dwells behind them, do not keep."""
        actions, walk = self.heads[h], self.walks[h]
        beyond = walk.last[-1] if walk.last else 0
        for k in np.flatnonzero(np.diff(actions.after_offsets)).tolist():
            first = self.begins[h][k] or beyond + 1
            for edge in actions.after_edges(k):
                if edge.head == h:
                    continue
                what = f"action {edge.action} of head {self.names[edge.head]}"
                if edge.point != ACTION_END:
                    what = f"point {edge.point} of {what}"
                if self.known.done(h, first, edge.head) <= self._reached(edge):
                    yield f"head {actions.head} action {k} does not wait for {what}"
                elif edge.lag_s > self._dwelt(h, edge, first) + LAG_TOLERANCE_S:
                    yield (
                        f"head {actions.head} action {k} does not dwell for {edge.lag_s:g} s "
                        f"after {what}"
                    )

    def _reached(self, edge: After) -> int:
        """Return the line of the move that ends at the point an edge waits for."""
        walk = self.walks[edge.head]
        at_end = edge.point == ACTION_END
        return walk.last[edge.action] if at_end else walk.reached[edge.action][edge.point]

    def _dwelt(self, h: int, edge: After, first: int) -> float:
        """Return the seconds head h dwells above line `first` since it knows an edge is kept.

        What a head knows never grows less, so the wait behind which it knows is found by bisection.
        """
        rests, reached = self.files[h].rests, self._reached(edge)
        row = bisect_right(
            rests.waits, reached, key=lambda line: self.known.done(h, line + 1, edge.head)
        )
        wait = rests.waits[row] if row < len(rests.waits) else first
        return rests.between_s(wait, first)

    def unrested(self, h: int) -> Iterator[str]:
        """Yield the waits of one head for which its file does not dwell as long as planned."""
        actions, walk = self.heads[h], self.walks[h]
        for k in np.flatnonzero(actions.kind == ActionKind.WAIT).tolist():
            first = self.begins[h][k] or walk.last[k] + 1
            edges = [edge for edge in actions.after_edges(k) if edge.head != h]
            due = float(actions.end_s[k] - actions.begin_s[k])
            due += max((edge.lag_s for edge in edges), default=0.0)
            dwelt = [self._dwelt(h, edge, first) for edge in edges]
            dwelt.append(self.files[h].rests.between_s(walk.last[k], first))
            if min(dwelt) < due - LAG_TOLERANCE_S:
                yield (
                    f"head {actions.head} dwells {min(dwelt):.1f} s for action {k}, planned "
                    f"{due:.1f} s"
                )

    def stops(self, h: int) -> Iterator[str]:
        """Yield the lines that make a head stand still within an action."""
        file, walk = self.files[h], self.walks[h]
        for line in file.rests.dwells + [sync.line for sync in file.syncs if not sync.moving]:
            k = bisect_right(walk.last, line)
            if k < len(walk.first) and 0 < walk.first[k] < line:
                yield f"head {self.names[h]} line {line} stops the head within action {k}"

    def unplanned(self, h: int) -> Iterator[str]:
        """Yield the waits of one head's body that stand for no edge of the plan."""
        low, high = self.windows[h]
        for sync in self.files[h].syncs:
            if sync.signal or not self.parts[h].parked < sync.line < self.lasts[h]:
                continue
            g, signal = self.given[sync.number]
            if not signal.moving and signal.line < self.firsts[g]:
                continue
            actions = range(bisect_right(high, sync.line), bisect_left(low, sync.line))
            edges = [e for k in actions for e in self.heads[h].after_edges(k) if e.head == g]
            meant = {(e.action, ACTION_END if self._is_end(e) else e.point) for e in edges}
            signalled = self._signalled(g, signal)
            if signalled & meant:
                continue
            acts = {action for action, _ in signalled}
            places = [self._reached(edge) for edge in edges if edge.action in acts]
            if not any(self.intervals.excuse(g, place, signal.line) for place in places):
                yield f"head {self.names[h]} line {sync.line} waits where no plan does"

    def _signalled(self, g: int, signal: Sync) -> set[tuple[int, int]]:
        """Return which ends of actions, or points within one, a signal of head g may stand for."""
        (low, high), line = self.windows[g], signal.line
        ended = range(bisect_right(high, line) - 1, bisect_left(low, line) - 1)
        signalled, walk = {(action, ACTION_END) for action in ended}, self.walks[g]
        k = bisect_right(walk.last, line)
        if signal.moving and k < len(walk.reached):
            latest = max((at for at in walk.reached[k][1:] if at < line), default=0)
            points = enumerate(walk.reached[k])
            signalled |= {(k, point) for point, at in points if point and at == latest}
        return signalled

    def _is_end(self, edge: After) -> bool:
        """Tell whether what is waited for is the end of an action, its last point included."""
        path = self.heads[edge.head].action_path(edge.action)
        return edge.point in (ACTION_END, len(path) - 1)


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
