"""One head's file walked along its actions of a plan, move by move.

Between two actions a head may push or pull filament standing still. After a bead it may wipe
back along it, but not past a point that another head waits for: that one may be there already.
Every other move must be the plan's.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache, partial

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.formats.gcode import GcodeDocument
from decmcts.print.job import DEFAULT_TRAVEL, PrintJob
from decmcts.print.machine import Practice
from decmcts.print.plan import ACTION_END, ActionKind, HeadActions, JointPlan
from sim.content.seams import Laid, laid_by
from sim.files.commands import states_in_force
from sim.heads.file import (
    E_MM,
    FEED_MM_S,
    SAME_MM,
    ContourMoves,
    HeadFile,
    Settings,
    words_of,
)

OWED_MM = 1e-3
SURPLUS_MM = 0.01
_SHARES = np.linspace(0.0, 1.0, 9)  # of a wipe, at which it is looked at
_PRINT, _TRAVEL, _PARK, _ = map(int, ActionKind)  # plain numbers compare faster


@dataclass(slots=True)
class Walk:
    """Where each action of a head stands in its file, and what is wrong there."""

    first: list[int] = field(default_factory=list)  # (k,) line of each action's first move
    last: list[int] = field(default_factory=list)  # (k,) line of the last move up to its end
    reached: list[list[int]] = field(default_factory=list)  # (k,) line of the move to each point
    laid: list[ContourMoves] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    complete: bool = False

    def ahead(self, beyond: int) -> list[int]:
        """Return the line of the first move of each action or of a later one, (k + 1,).

        It is `beyond` where there is none.
        """
        lines = [*self.first, beyond]
        for k in range(len(self.first) - 1, -1, -1):
            if lines[k] <= 0:
                lines[k] = lines[k + 1]
        return lines


class Walker:
    """Walks the moves begin..end - 1 of a file along its head's actions."""

    def __init__(
        self, file: HeadFile, actions: HeadActions, job: PrintJob, document: GcodeDocument,
        begin: int, end: int, blocks: set[int], waited: Mapping[int, int], practice: Practice,
        kept: Settings,
    ) -> None:  # fmt: skip
        """Take for each action the last of its points that another head waits for (`waited`).

        `practice` is what the head does where it stands idle, `kept` as in `words_of`.
        """
        self.file, self.actions, self.job, self.document = file, actions, job, document
        self.at, self.end, self.blocks, self.waited = begin, end, blocks, waited
        self.walk = Walk()
        self._kept = kept
        motion = file.motion  # as plain numbers, for what is asked of one move at a time, each (m,)
        self._to = [column.tolist() for column in motion.points[1:].T]  # x, y and z
        self._feed = motion.feed.tolist()
        self._extrusion, self._line = motion.extrusion.tolist(), (motion.line + 1).tolist()
        self._state = file.track.at(motion.line).tolist()  # row of the states in force
        still = np.abs(np.diff(motion.points.T.copy(), axis=1)) < 1e-9
        self._stays: list[bool] = np.logical_and.reduce(still).tolist()
        self._kind, self._contour = actions.kind.tolist(), actions.contour.tolist()
        self._apart = _apart_in_file(actions.path, actions.path_offsets, document.decimals[0])
        self._bounds = actions.path_offsets.tolist()
        self._alike: dict[tuple[int, int], str] = {}
        self._ours = cache(partial(states_in_force, file.track.table))  # states in words, by row
        self._theirs = cache(partial(states_in_force, document.states))
        starts = [*document.starts, document.end]
        starts += [block.begin for block in document.blocks] + [b.end for b in document.blocks]
        first = int(job.contours.epoch.min(initial=0))
        behind = [(first, cursor) for cursor in document.starts]
        behind += [(b.epoch, b.end) for b in document.blocks]
        self._left: dict[int, float] = {}  # what stays retracted behind the source's own lines, mm
        for epoch, cursor in behind:
            left = max(0.0, cursor.pulled - cursor.owed)
            self._left[epoch] = max(self._left.get(epoch, 0.0), left)
        self._deepest = max(
            *(settings.retract_mm for settings in job.settings.each()),
            float(document.owed.max(initial=0.0)),
            *(c.owed for c in starts),
            practice.retract_mm,
        ) + max(self._left.values())
        beyond = max(c.owed - c.pulled for c in starts)
        self._surplus = max(0.0, beyond, -float(document.owed.min(initial=0.0)))
        self._surplus += practice.prime_mm
        travel_feed = job.settings.travel_feed or DEFAULT_TRAVEL
        feeds = (travel_feed, job.settings.z_feed or travel_feed)
        self._travels = cache(lambda feed: min(abs(feed - due) for due in feeds) <= FEED_MM_S)
        self._wipe_feeds = {each.wipe_feed or travel_feed for each in job.settings.each()}

    def run(self) -> Walk:
        """Return the walk; it ends at the first move that is not the plan's."""
        for k in range(len(self.actions)):
            self.walk.first.append(-1)
            self.walk.reached.append([])
            problem = ""  # it rests: `sim.heads.order` looks for the dwell
            if self._kind[k] == _PRINT:
                problem = self._print(k) or self._wipe(k)
            elif self._kind[k] in (_TRAVEL, _PARK):
                problem = self._travel(k)
            if problem:
                self.walk.faults.append(problem)
                return self.walk
            self.walk.last.append(self._line[self.at - 1])
        while self.at < self.end:
            if not self._stays[self.at]:
                self.walk.faults.append(f"line {self._line[self.at]} is a move no plan has")
                return self.walk
            self._still()
        self.walk.complete = True
        return self.walk

    def _travel(self, k: int) -> str:
        rows = slice(self._bounds[k], self._bounds[k + 1])
        path, apart = self.actions.path[rows], self._apart[rows]
        line = self._line[self.at - 1]
        reached = self.walk.reached[k] = []
        for is_apart, (x, y, z) in zip(apart.tolist(), path.tolist(), strict=True):
            if not is_apart:
                reached.append(line)
                continue
            while self.at < self.end and self._stays[self.at]:
                self._still()
            if self.at >= self.end:
                return f"the file ends before action {k}"
            here, line = [column[self.at] for column in self._to], self._line[self.at]
            if (
                abs(here[0] - x) > SAME_MM
                or abs(here[1] - y) > SAME_MM
                or abs(here[2] - z) > SAME_MM
            ):
                due = _xyz((x, y, z))
                return f"line {line} goes to {_xyz(here)}, the plan's action {k} to {due}"
            if abs(self._extrusion[self.at]) > E_MM:
                return f"line {line} pushes filament while it travels"
            if not self._travels(self._feed[self.at]):
                return f"line {line} travels at {self._feed[self.at]:.3f} mm/s"
            self._step(k)
            reached.append(line)
        return ""

    def _print(self, k: int) -> str:
        contour, laid = self._contour[k], laid_by(self.job.contours, self.actions, k)
        if isinstance(laid, str):
            return f"contour {contour} {laid}"
        while self.at < self.end and self._stays[self.at] and not self._is_dot(contour, laid):
            self._still()
        line = self._line[min(self.at, self.end - 1)]
        owed = float(self.file.motion.extruder[max(line - 2, 0), 1])
        if self.file.motion.modes[max(line - 2, 0), 3] or owed > self._due(contour) + OWED_MM:
            return f"line {line} begins contour {contour} with {owed:g} mm retracted"
        reached = self.walk.reached[k]
        reached.append(self._line[self.at - 1])
        stop = self.at + len(laid.extrusion)
        self.walk.laid.append(ContourMoves(contour, self.at, stop))
        if stop <= self.end and self._as_laid(laid, stop):
            reached += self._line[self.at : stop]
            if stop > self.at:
                self._step(k)
            self.at = stop
            return ""
        return self._print_each(k, laid)

    def _as_laid(self, laid: Laid, stop: int) -> bool:
        """Tell whether all moves up to `stop` lay down what they should, in one look at each."""
        motion, rows = self.file.motion, slice(self.at, stop)
        mine = self._state[rows]
        return bool(
            (np.abs(motion.points[self.at + 1 : stop + 1] - laid.points[1:]) <= SAME_MM).all()
            and (np.abs(motion.extrusion[rows] - laid.extrusion) <= E_MM).all()
            and (np.abs(motion.feed[rows] - laid.feed) <= FEED_MM_S).all()
            and not any(
                self._other_state(*pair) for pair in set(zip(mine, self._states(laid), strict=True))
            )
        )

    def _print_each(self, k: int, laid: Laid) -> str:
        """Go along a contour move by move up to the first that is not as it should be."""
        contour, motion = int(self.actions.contour[k]), self.file.motion
        reached, states = self.walk.reached[k], self._states(laid)
        for s in range(len(laid.extrusion)):
            if self.at >= self.end:
                return f"the file ends within contour {contour}"
            line, to = self._line[self.at], laid.points[s + 1]
            if np.abs(motion.points[self.at + 1] - to).max() > SAME_MM:
                return (
                    f"line {line} goes to {_xyz(motion.points[self.at + 1])}, "
                    f"contour {contour} to {_xyz(to)}"
                )
            for has, due, tolerance, unit in (
                (motion.extrusion[self.at], laid.extrusion[s], E_MM, "mm of filament"),
                (motion.feed[self.at], laid.feed[s], FEED_MM_S, "mm/s"),
            ):
                if abs(has - due) > tolerance:
                    return f"line {line} has {has:.5f} {unit}, contour {contour} {due:.5f}"
            if problem := self._other_state(self._state[self.at], states[s]):
                return f"line {line}: {problem}"
            self._step(k)
            reached.append(line)
        return ""

    def _is_dot(self, contour: int, laid: Laid) -> bool:
        """Tell whether a move of filament alone is what a contour begins with on the spot.

        What stands before it pushes back what was retracted.
        """
        ends = list(zip(*laid.points[:2].tolist(), strict=True))  # x, y and z of both
        decimals = self.document.decimals[0]
        if max(abs(a - b) for a, b in ends) > SAME_MM:  # rounding takes half a digit from each
            return False
        if any(round(a, decimals) != round(b, decimals) for a, b in ends):
            return False
        owed = float(self.file.motion.extruder[max(self._line[self.at] - 2, 0), 1])
        pushed = float(self.file.motion.extrusion[self.at])
        return owed <= self._due(contour) + OWED_MM and bool(
            abs(pushed - laid.extrusion[0]) <= E_MM
        )

    def _states(self, laid: Laid) -> list[int]:
        rows: list[int] = self.document.point_state[laid.rows].tolist()
        return rows

    def _due(self, contour: int) -> float:
        """Return what may be retracted where a contour begins, mm.

        As much as in the source, and what a bead too small to make up for it has left over.
        """
        left = self._left.get(int(self.job.contours.epoch[contour]), 0.0)
        if self.walk.laid:
            last = self._line[self.walk.laid[-1].end - 1]
            left = max(left, float(self.file.motion.extruder[last - 1, 1]))
        return max(0.0, float(self.document.owed[contour]) + left)

    def _wipe(self, k: int) -> str:
        """Go past moves that pull filament back along the bead just printed."""
        motion, path = self.file.motion, self.actions.action_path(k)[self.waited.get(k, 0) :]
        while self.at < self.end:
            if self._stays[self.at]:
                if self._line[self.at] in self.blocks or not self._wipes_next():
                    return ""
                self._still()
                continue
            if motion.extrusion[self.at] >= 0.0:
                return ""
            begin, end = motion.points[self.at : self.at + 2]
            if max(_distance(begin + t * (end - begin), path) for t in _SHARES) > 2 * SAME_MM:
                return f"line {self._line[self.at]} wipes beside contour {self.actions.contour[k]}"
            feed = float(motion.feed[self.at])
            if min(abs(feed - due) for due in self._wipe_feeds) > FEED_MM_S:
                return f"line {self._line[self.at]} wipes at {feed:.3f} mm/s"
            self._step(k)
        return ""

    def _wipes_next(self) -> bool:
        m = self.at
        while m < self.end and self._stays[m]:
            m += 1
        return m < self.end and bool(self.file.motion.extrusion[m] < 0.0)

    def _still(self) -> None:
        """Go past a move of filament alone and check its length."""
        motion, line = self.file.motion, self._line[self.at]
        pushed = float(motion.extrusion[self.at])
        owed = float(motion.extruder[max(line - 2, 0), 1])
        if line not in self.blocks and pushed > owed + self._surplus + SURPLUS_MM:
            self.walk.faults.append(f"line {line} pushes {pushed:.3f} mm of filament on the spot")
        if line not in self.blocks and owed - pushed > self._deepest + SURPLUS_MM:
            self.walk.faults.append(f"line {line} retracts {owed - pushed:.3f} mm")
        self.at += 1

    def _step(self, k: int) -> None:
        if self.walk.first[k] < 0:
            self.walk.first[k] = self._line[self.at]
        self.at += 1

    def _other_state(self, mine: int, row: int) -> str:
        if (mine, row) not in self._alike:
            words = words_of(self._ours(mine), self._theirs(row), self._kept)
            self._alike[mine, row] = ", ".join(words)
        return self._alike[mine, row]


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


def _apart_in_file(path: Floats, offsets: Ints, decimals: int) -> Flags:
    """Tell which points a file of so many decimals tells from the one before in their path, (n,).

    Path i is path[offsets[i]:offsets[i + 1]].
    """
    steps = np.abs(np.diff(np.round(path, decimals), axis=0, prepend=np.inf))
    apart = np.asarray((steps > 0.5 * 10.0**-decimals).any(axis=1))
    apart[offsets[:-1][offsets[:-1] < len(path)]] = False
    return apart


def _distance(point: Floats, path: Floats) -> float:
    a, way = path[:-1], np.diff(path, axis=0)
    square = np.maximum((way**2).sum(axis=1), 1e-18)
    t = np.clip(((point - a) * way).sum(axis=1) / square, 0.0, 1.0)
    return float(np.linalg.norm(a + t[:, None] * way - point, axis=1).min())


def _xyz(point: Iterable[float]) -> str:
    return "(" + ", ".join(f"{v:.3f}" for v in point) + ")"
