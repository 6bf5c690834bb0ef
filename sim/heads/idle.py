"""What heads do where they stand idle: pulled back further, cooled to standby, heated again.

docs/gcode.md (*Where a head stands idle*) says where and how. By the plan's times a head's next
action begins long after the one before has ended, or is a long rest; a bead of it must follow, and
none of the source's own lines stand in between. Between two actions it may be told another
temperature, in these lines and no others: M400, M104 to standby, a dwell, M104 back, what it waits
for, M109. Files without their plan tell no times, so how far is pulled back is not looked at then.
How hot a head may be where it prints is compared bead by bead (`sim.heads.changes`).
"""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from decmcts.print.job import PrintJob
from decmcts.print.machine import Idle, Practice
from decmcts.print.plan import ActionKind, HeadActions
from sim.heads.file import HeadFile
from sim.heads.walk import OWED_MM, Walk

_SETS_HEAT = re.compile(rb"M(104|109) S(\d++(?:\.\d*+)?|\.\d++)\Z", re.I)
_STATED = re.compile(rb"M10[49] [SR] ?(\d++(?:\.\d*+)?|\.\d++)\Z", re.I)  # by any source
_HEATS = re.compile(rb"M0*10[49](?!\d)", re.I)
# What heats or cools in a way of its own: macros, homing and probing, changes, pauses, and more.
_UNSEEN = re.compile(
    rb"(?![GMT]\d|EXCLUDE_OBJECT|SET_(?:PRINT_STATS_INFO|VELOCITY_LIMIT|PRESSURE_ADVANCE|RETRACTION"
    rb"|FAN_SPEED)\b)|T\d|G0*2[89](?![\d.])|G0*10(?=.*[PL])"
    rb"|G0*2[89]\.|G0*3[034](?!\d)|M0*(?:98|32|30[36]|568|60[0-2]|62\d|70[12]|999|1002)(?!\d)"
    rb"|M0*(?:0|1|25|125|226)(?![\d.])",
    re.I,
)


@dataclass(frozen=True, slots=True)
class Idling:
    """Where a head stands idle, and what it has to do there."""

    practice: Practice  # the machine's words before the source's
    stands: Set[int] | None  # actions before which it does; None: no plan says
    pulled: Set[int] | None  # contours before which it does
    primed: Set[int] | None  # contours before which it has laid nothing for long

    @classmethod
    def of(
        cls, idle: Idle, actions: HeadActions, job: PrintJob, tool: int | None, *, timed: bool
    ) -> Idling:
        """Return what a head has to do by its actions; by none of their times unless `timed`."""
        practice = idle.over(job.practice(tool))
        if tool is not None and job.settings.for_tool(tool).firmware_retraction:
            practice = replace(practice, retract_mm=0.0)  # the firmware knows no other length
        if not timed:
            return cls(practice, None, None, None)
        stands = frozenset(_idle_stands(actions, job, idle.after_s))
        prints = np.flatnonzero(actions.kind == ActionKind.PRINT)
        pulled = actions.contour[prints[np.searchsorted(prints, sorted(stands))]]
        ends = np.concatenate([[0.0], actions.end_s[prints]])[:-1]  # since when it lays none
        primed = actions.contour[prints[actions.begin_s[prints] - ends >= idle.after_s]]
        return cls(practice, stands, frozenset(pulled.tolist()), frozenset(primed.tolist()))


def _idle_stands(actions: HeadActions, job: PrintJob, after_s: float) -> Iterator[int]:
    """Yield the actions before which a head stands idle."""
    kind, contour = actions.kind.tolist(), actions.contour.tolist()
    begin, end = actions.begin_s.tolist(), actions.end_s.tolist()
    epochs, held = job.contours.epoch, list[int]()
    now, before = int(epochs.min(initial=0)), 0.0
    for k, does in enumerate(kind):
        rests = end[k] - begin[k] if does == ActionKind.WAIT else 0.0
        if begin[k] - before + rests >= after_s:
            held.append(k)
        before = end[k]
        if does == ActionKind.PRINT:
            if (epoch := int(epochs[contour[k]])) == now:
                yield from held
            held, now = [], epoch


class StandbyLines(NamedTuple):
    """Lines that cool a hot end and heat it again."""

    lines: tuple[int, ...]  # of M400, M104, M104 and M109
    degrees: tuple[float, ...]  # of the last three


@dataclass(frozen=True, slots=True)
class _Heats:
    """Lines of a file that heat or cool, ascending, found once for all that is asked of it."""

    heats: list[int]  # commands to the hot end,
    stated: list[float | None]  # degrees that each states, where it is a plain one
    unseen: list[int]  # commands that may heat or cool in a way of their own

    @classmethod
    def of(cls, file: HeadFile) -> _Heats:
        found = cls([], [], [])
        for line, code in file.others:
            if _HEATS.match(code):
                match = _STATED.match(code)
                found.heats.append(line)
                found.stated.append(None if match is None else float(match[1]))
            elif _UNSEEN.match(code):
                found.unseen.append(line)
        return found

    def stated_above(self, line: int) -> float | None:
        """Return how hot the hot end was told to be above a line; None: it is not known."""
        k = bisect_left(self.heats, line) - 1
        later = bisect_right(self.unseen, self.heats[k]) if k >= 0 else 0
        unseen = later < len(self.unseen) and self.unseen[later] < line
        return None if k < 0 or unseen else self.stated[k]


def _between(lines: Sequence[int], above: int, below: int) -> Sequence[int]:
    return lines[bisect_right(lines, above) : bisect_left(lines, below)]


def check_idle(
    file: HeadFile, walk: Walk, begin: int, end: int, taken: Set[int], idling: Idling,
    beyond_mm: float = 0.0,
) -> tuple[list[str], set[int]]:  # fmt: skip
    """Check what a file does where its head stands idle, between lines `begin` and `end`.

    Returns what is wrong, and the lines that cool and heat again there.

    `taken` are the lines that are the source's own. Before the head's first bead it may have so
    much less retracted as the source pushes there beyond what was pulled (`beyond_mm`).
    """
    own = [
        (line, code)
        for line, code in file.others
        if begin < line < end and line not in taken and (code == b"M400" or _SETS_HEAT.match(code))
    ]
    groups, heats = list(_standbys(own)), _Heats.of(file)
    words = [text for group in groups for text in _heated_wrong(file, heats, group, idling)]
    windows = list(zip([begin, *walk.last], walk.ahead(end), strict=True))[:-1]
    words += _pushed(file, windows, idling, walk, beyond_mm)
    return words, {line for group in groups for line in group.lines}


def _standbys(own: Sequence[tuple[int, bytes]]) -> Iterator[StandbyLines]:
    """Yield the lines that cool and heat again, of those that might; others are left."""
    k = 0
    while k < len(own):
        rows = own[k : k + 4]
        matches = [_SETS_HEAT.match(code) for _, code in rows[1:]]
        names = [None if match is None else match[1] for match in matches]
        if rows[0][1] == b"M400" and names == [b"104", b"104", b"109"]:
            degrees = tuple(float(match[2]) for match in matches if match is not None)
            yield StandbyLines(tuple(line for line, _ in rows), degrees)
            k += 4
        else:
            k += 1


def _heated_wrong(
    file: HeadFile, heats: _Heats, group: StandbyLines, idling: Idling
) -> Iterator[str]:
    """Yield what is wrong with the temperatures of a standby, or moves and signals within it."""
    first, last = group.lines[0], group.lines[-1]
    cold, warm, hot = group.degrees
    due = heats.stated_above(first)
    if due is None:
        yield f"line {group.lines[1]}: it cools, and how hot it was is not known"
    elif not warm == hot == due:
        yield f"line {last}: it is heated to {hot:g} degrees, above it was {due:g}"
    if idling.practice.standby_c is None:
        yield f"line {group.lines[1]}: it cools, which neither source nor machine does"
    elif cold != idling.practice.standby_c or (due is not None and cold >= due):
        yield (
            f"line {group.lines[1]}: it cools to {cold:g} degrees, standby is "
            f"{idling.practice.standby_c:g}"
        )
    others = {*_between(heats.heats, first, last), *_between(heats.unseen, first, last)}
    for line in sorted(others - set(group.lines)):
        yield f"line {line}: it may be heated or cooled otherwise while it stands at standby"
    if file.motion.before[first - 1] != file.motion.before[last - 1]:
        yield f"line {first}: it moves before it is hot again in line {last}"
    if _between(file.rests.signals, first, last):
        yield f"line {first}: others wait for it until it is hot again in line {last}"


def _pushed(
    file: HeadFile, windows: Sequence[tuple[int, int]], idling: Idling, walk: Walk, beyond_mm: float
) -> Iterator[str]:
    """Yield the stands in which filament is not pulled back as far as it has to be."""
    motion, first = file.motion, walk.laid[0].begin if walk.laid else len(file.motion.line)
    still = sorted(file.rests.waits + file.rests.dwells)
    for k in sorted(idling.stands or ()):
        low, high = windows[k]
        last = bisect_left(still, high) - 1  # others may be for what stands still above
        at = still[last] if last >= 0 and still[last] > low else high
        owed = float(motion.extruder[max(at - 2, 0), 1])
        is_early = int(motion.before[at - 1]) <= first
        deep = idling.practice.retract_mm - (beyond_mm if is_early else 0.0)
        if owed < deep - OWED_MM:
            yield f"line {at}: it stands idle with {owed:g} mm retracted, {deep:g} are due"
