"""G-code of one head in a planned order: same extrusions, travels made anew.

The preamble, the postamble and every block are the source's bytes; between
them lines are written by an `Emitter` that keeps the machine state in step.

Planners see chords. Where a traversal runs along all chords of an arc of the source, or along
some from one of its ends or between two vertices, that is an arc again: the same circle,
the other way round if reversed. Where others are told that the head has come to a vertex within
one it is two, for a line has no place for that. What a seam's gap leaves of a chord is a straight
line.

M73 is counted anew from the plan's own times where the source has any; which of its words a
source uses lives in `dialects.stated_times`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO, NamedTuple, TextIO

import numpy as np

from decmcts.arrays import Floats
from decmcts.errors import InputError
from decmcts.formats.gcode.dialects.dialect import SPLIT_MARK
from decmcts.formats.gcode.dialects.stated_times import M73, WORD, without_progress
from decmcts.formats.gcode.document import NO_ARC, Block, GcodeDocument
from decmcts.formats.gcode.text.source_text import save_text
from decmcts.formats.gcode.writing.beads import BeadRows
from decmcts.formats.gcode.writing.emitter import NEAR_MM, Emitter, Point
from decmcts.formats.gcode.writing.own_header import with_header
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.loops import traversal
from decmcts.print.loops_kernels import SLIVER_MM, Rotated
from decmcts.print.plan import ActionKind, HeadActions
from decmcts.print.walls import walls_for


def write_gcode(
    document: GcodeDocument,
    job: PrintJob,
    actions: HeadActions,
    out: Path | str | BinaryIO | TextIO,
    *,
    header_lines: Sequence[str] = (),
) -> None:
    """Write the plan of one head as G-code in the source's dialect.

    The path of the first travel is not followed (it starts at the head's park
    position, where the preamble does not leave it): the head goes a little above
    the bed; after the last contour the head goes over the print to above where the
    source's postamble begins.

    A path is written atomically, gzipped if it ends in ``.gz``.

    Raises InputError when a contour is missing or doubled, or `out` cannot be written.
    """
    _check_once(job, actions, document)
    emitter = Emitter(document, job.settings, walls_for(job))
    beads = BeadRows.of(document, job)
    progress = ProgressWriter(document, actions)
    preamble = progress.above(document.preamble)
    emitter.verbatim(with_header(preamble, header_lines, document.newline))
    emitter.use(document.start.tool)
    blocks = iter(document.blocks)
    block = next(blocks, None)
    path: list[Floats] = []
    ahead = prints_ahead(actions)
    for k, kind in enumerate(map(ActionKind, actions.kind.tolist())):
        if kind is ActionKind.TRAVEL:
            path.append(actions.action_path(k))
        if kind is ActionKind.WAIT:
            if ahead[k] >= 0:
                emitter.states.set_travel(first_state(beads, document, actions, ahead[k]))
            emitter.retract()
            _follow(emitter, path)
            emitter.dwell(float(actions.end_s[k] - actions.begin_s[k]))
            path = []
        if kind is not ActionKind.PRINT:
            continue
        contour = int(actions.contour[k])
        while block is not None and block.epoch <= job.contours.epoch[contour]:
            emit_block(emitter, block)
            path = [] if block.moves else path
            block = next(blocks, None)
        progress.write(emitter, k)
        print_contour(
            emitter, beads, contour, path, is_reversed=bool(actions.reversed[k]),
            entry=int(actions.entry[k]),
        )  # fmt: skip
        path = []
    for rest in ([block] if block is not None else []) + list(blocks):
        emit_block(emitter, rest)
    _finish(emitter)
    save_text(emitter.text(), out)


def prints_ahead(actions: HeadActions) -> list[int]:
    """Return for each action which one prints next, itself too, -1 for none."""
    prints = actions.kind == ActionKind.PRINT
    numbers = np.where(prints, np.arange(len(prints)), len(prints))
    ahead = np.minimum.accumulate(numbers[::-1])[::-1]
    return list(np.where(ahead < len(prints), ahead, -1).tolist())


def first_state(beads: BeadRows, document: GcodeDocument, actions: HeadActions, action: int) -> int:
    """Return the state in which an action that prints begins."""
    contour, entry = int(actions.contour[action]), int(actions.entry[action])
    if beads.plain[contour] and not entry:
        return beads.state[contour]
    rows = traversal(beads.job.contours, contour, entry).rows[1:]
    return int(document.point_state[rows[-1] if actions.reversed[action] else rows[0]])


def _check_once(job: PrintJob, actions: HeadActions, document: GcodeDocument) -> None:
    printed = actions.contour[actions.kind == ActionKind.PRINT]
    count = np.bincount(printed, minlength=len(job.contours))
    if (wrong := np.flatnonzero(count != 1)).size:
        c = int(wrong[0])
        raise InputError(
            f"the plan prints contour {c} {count[c]} times instead of once", path=document.path
        )


def emit_block(emitter: Emitter, block: Block) -> None:
    """Write a verbatim block with the controller brought to where the source had it."""
    begin = block.begin
    if not block.moves:
        if begin.position[2] > emitter.at[2] + NEAR_MM:
            x, y, _ = emitter.at
            emitter.travel([(x, y, begin.position[2])])
    elif math.dist(emitter.at, begin.position) >= NEAR_MM:
        emitter.states.set_travel(begin.state)
        emitter.bridge(begin.position)
    emitter.owe(begin.owed, firmware=begin.firmware_retracted)
    left = emitter.owed - begin.owed
    emitter.states.set(begin.state)
    emitter.set_e(begin.e)
    emitter.set_feed(begin.feed)
    stood = emitter.at
    emitter.verbatim(b"".join(without_progress(block.text)))
    emitter.take(block.end)
    emitter.owed += left
    emitter.use(block.end.tool)
    emitter.parted = True  # as it parted the contours in the source
    emitter.leave()
    if not block.moves:
        emitter.at = stood


def print_contour(
    emitter: Emitter,
    beads: BeadRows,
    contour: int,
    path: list[Floats],
    *,
    is_reversed: bool,
    entry: int,
    passed: Mapping[int, str] | None = None,
) -> None:
    """Travel to a contour and print it in the chosen traversal.

    Filament, feed and machine state go with each segment; an arc of the source is one again.
    `passed` has what is to be said, without a stop, where the head has come to points of the
    traversal, and an arc is two that meet there; it does not wipe
    back over the last of them, for other heads may be there by then.
    """
    commands = passed or {}
    plain = beads.plain[contour] and not entry and not commands
    way = None if plain else traversal(beads.job.contours, contour, entry)
    step = -1 if is_reversed else 1
    if way is None:
        points, state = beads.job.contours.polyline(contour)[::step], beads.state[contour]
    else:
        points = way.points[::step]
        state = int(emitter.document.point_state[way.rows[1:]][::step][0])
    begin: Point = tuple(points[0].tolist())
    emitter.states.set(state, before_travel=True)
    if math.dist(begin, emitter.at) >= NEAR_MM:
        emitter.states.set_travel(state)
    written = len(emitter.lines)
    _go(emitter, path, begin)
    first = emitter.top == -math.inf  # what the start code pushes belongs to the first bead
    if len(emitter.lines) == written and not (emitter.parted or first):
        emitter.emit(SPLIT_MARK)  # above what is pushed on the spot, or that were the last bead's
    emitter.restart(float(emitter.document.owed[contour]))
    emitter.parted = False
    if way is None:
        emitter.states.set(state)
        ends = beads.ends(contour, is_reversed=is_reversed)
        left = beads.left(contour, is_reversed=is_reversed) if emitter.relative_e else []
        emitter.plain(ends, left, beads.feed[contour])
    else:
        _lay(emitter, beads.job, way, commands, is_reversed=is_reversed)
    emitter.tail = points[max(commands, default=0) :][::-1]
    emitter.top = max(emitter.top, beads.top[contour])


def _lay(
    emitter: Emitter, job: PrintJob, way: Rotated, commands: Mapping[int, str], *, is_reversed: bool
) -> None:
    """Print along a traversal of a contour, segment by segment, and arc by arc where it has any."""
    step, document = -1 if is_reversed else 1, emitter.document
    points, filament = way.points[::step].tolist(), way.extrusion[1:][::step].tolist()
    feed = way.feed[1:][::step].tolist()
    state = document.point_state[way.rows[1:]][::step].tolist()
    arcs = arc_runs(document, job.contours, way, is_reversed=is_reversed, ends=commands)
    held, k = -1, 0
    while k < len(feed):
        if state[k] != held:
            held = state[k]
            emitter.states.set(held)
        if arc := arcs.get(k):
            until = arc.end
            pushed = float(sum(filament[k:until]))
            emitter.arc(tuple(points[until]), arc.centre, arc.clockwise, feed[k], pushed)
        else:
            until = k + 1
            emitter.move(tuple(points[until]), feed[k], filament[k])
        if until in commands:
            emitter.emit(commands[until])
        k = until


def _go(emitter: Emitter, path: list[Floats], begin: Point) -> None:
    """Follow the planned path if it starts here, else go over the print.

    The first path starts at the park position, where the start G-code does not
    leave the head; nothing is in the way yet but what was purged.
    """
    if emitter.top == -math.inf and math.dist(begin, emitter.at) >= NEAR_MM:
        emitter.approach(begin)
    else:
        _follow(emitter, path)
    if math.dist(begin, emitter.at) >= NEAR_MM:
        emitter.bridge(begin)
    if begin != emitter.at:
        emitter.move(begin, emitter.travel_feed)


def _follow(emitter: Emitter, path: list[Floats]) -> None:
    way = [tuple(p) for part in path for p in part.tolist()]
    if way and math.dist(way[0], emitter.at) < NEAR_MM:
        emitter.travel(way[1:])


def _finish(emitter: Emitter) -> None:
    """Bring the controller to where the source ended, then write the postamble.

    The head stays above the print, for what was printed there is cold by now; only
    where the last bead ends as the source's does it stands on it, as there.
    """
    end = emitter.document.end
    if math.dist(emitter.at, end.position) >= NEAR_MM:
        emitter.states.set_travel(end.state)
    emitter.hover(end.position)
    if abs(emitter.owed - end.owed) > 1e-6:  # be it but rounding: nothing is left for later
        emitter.retract()
    emitter.owe(end.owed, firmware=end.firmware_retracted)
    emitter.states.set(end.state)
    emitter.set_e(end.e)
    emitter.set_feed(end.feed)
    emitter.verbatim(b"".join(without_progress(emitter.document.postamble)))


class ArcRun(NamedTuple):
    """Segments first..end - 1 of a traversal, in the order they are printed, that are one arc."""

    end: int
    centre: tuple[float, float]  # mm
    clockwise: bool


def arc_runs(
    document: GcodeDocument, contours: Contours, way: Rotated, *, is_reversed: bool,
    ends: Collection[int] = (),
) -> dict[int, ArcRun]:  # fmt: skip
    """Return the arcs of a traversal by their first segment.

    `way` runs forwards; with `is_reversed` its segments are counted from its end. At the points
    `ends`, counted alike, an arc ends and another begins.
    """
    if not len(document.arcs.centre):
        return {}
    rows = way.rows[1:]
    arc = document.point_arc[rows]
    if not (arc != NO_ARC).any():
        return {}
    whole = (np.abs(way.points[:-1] - contours.points[rows - 1]) < SLIVER_MM).all(axis=1)
    whole &= (np.abs(way.points[1:] - contours.points[rows]) < SLIVER_MM).all(axis=1)
    arc = np.where(whole, arc, NO_ARC)
    parted = (np.diff(arc) != 0) | (np.diff(rows) != 1)
    inner = np.array([point for point in ends if 0 < point < len(rows)], np.int64)
    parted[(len(rows) - inner if is_reversed else inner) - 1] = True
    begins = np.concatenate([[0], np.flatnonzero(parted) + 1])
    ends = np.append(begins[1:], len(rows))
    runs: dict[int, ArcRun] = {}
    for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
        number = int(arc[begin])
        if number == NO_ARC or not _stands_alone(document, number, rows[begin], rows[end - 1]):
            continue
        first, last = (len(rows) - end, len(rows) - begin) if is_reversed else (begin, end)
        x, y = document.arcs.centre[number].tolist()
        runs[first] = ArcRun(last, (x, y), bool(document.arcs.clockwise[number]) != is_reversed)
    return runs


def _stands_alone(document: GcodeDocument, arc: int, first: int, last: int) -> bool:
    """Tell whether an arc from row `first` to row `last` reads back as these chords."""
    inside = document.point_arc[[first - 1, min(last + 1, len(document.point_arc) - 1)]] == arc
    inside[1] &= last + 1 < len(document.point_arc)
    return bool(document.arcs.partible[arc]) or not inside.any()


class ProgressWriter:
    """Writes M73 anew from the plan's own times, where the source had any."""

    def __init__(self, document: GcodeDocument, actions: HeadActions) -> None:
        self._begin = actions.begin_s
        self._total = float(actions.end_s.max(initial=0.0))
        self._words = document.habits.progress
        self._silent = document.habits.silent_share
        self._shown = -1

    def write(self, emitter: Emitter, action: int) -> None:
        """Write the progress at the beginning of an action if it changed."""
        if self._total <= 0.0 or not self._words:
            return
        percent = int(100.0 * self._begin[action] / self._total)
        if percent != self._shown:
            left = self._total - float(self._begin[action])
            for words in ("PR", "QS"):
                if set(words) & set(self._words):
                    emitter.emit(f"M73 {self._parameters(words, percent, left)}")
            self._shown = percent

    def _parameters(self, words: str, percent: float, left_s: float) -> str:
        """Return the parameters of one mode, of those the source has."""
        share = self._silent if words == "QS" else 1.0
        values = (f"{percent:.0f}", f"{left_s * share / 60.0:.0f}")
        return " ".join(f"{w}{v}" for w, v in zip(words, values, strict=True) if w in self._words)

    def above(self, preamble: bytes) -> bytes:
        """Return the start G-code with what its M73 say counted anew."""

        def count(match: re.Match[bytes]) -> bytes:
            left = self._total / 60.0 * (self._silent if match[1] in b"Ss" else 1.0)
            return match[1] + (b"0" if match[1] in b"PpQq" else f"{left:.0f}".encode())

        return b"".join(
            line if M73.match(line) is None else WORD.sub(count, line)
            for line in without_progress(preamble, keep=(b"P", b"R", b"Q", b"S"))
        )
