"""G-code of one head in a planned order: same extrusions, travels made anew.

The preamble, the postamble and every block are the source's bytes; between
them lines are written by an `Emitter` that keeps the machine state in step.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import BinaryIO, TextIO

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.formats.gcode.dialects.dialect import SPLIT_MARK
from decmcts.formats.gcode.dialects.stated_times import without_progress
from decmcts.formats.gcode.document import Block, GcodeDocument
from decmcts.formats.gcode.text.source_text import save_text
from decmcts.formats.gcode.writing.arcs import arc_runs
from decmcts.formats.gcode.writing.beads import Beads
from decmcts.formats.gcode.writing.emitter import NEAR_MM, Emitter, Point
from decmcts.formats.gcode.writing.own_header import with_header
from decmcts.formats.gcode.writing.progress import Progress
from decmcts.print.job import PrintJob
from decmcts.print.loops import traversal
from decmcts.print.loops_kernels import Rotated
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

    Parameters
    ----------
    out : path or stream
        A path is written atomically, gzipped if it ends in ``.gz``.
    header_lines : sequence of str
        Put at the top as comments.

    Raises
    ------
    InputError
        When a contour is missing or doubled, or `out` cannot be written.
    """
    _check_once(job, actions, document)
    save_text(gcode_bytes(document, job, actions, header_lines=header_lines), out)


def gcode_bytes(
    document: GcodeDocument,
    job: PrintJob,
    actions: HeadActions,
    *,
    header_lines: Sequence[str] = (),
) -> bytes:
    """Return what `write_gcode` writes."""
    emitter = Emitter(document, job.settings, walls_for(job))
    beads = Beads.of(document, job)
    progress = Progress(document, actions)
    preamble = progress.above(document.preamble)
    emitter.verbatim(with_header(preamble, header_lines, document.newline))
    emitter.use(document.start.tool)
    blocks = iter(document.blocks)
    block = next(blocks, None)
    path: list[NDArray[np.float64]] = []
    for k, kind in enumerate(map(ActionKind, actions.kind.tolist())):
        if kind is ActionKind.TRAVEL:
            path.append(actions.action_path(k))
        if kind is ActionKind.WAIT:
            pause(emitter, path, float(actions.end_s[k] - actions.begin_s[k]))
            path = []
        if kind is not ActionKind.PRINT:
            continue
        contour = int(actions.contour[k])
        while block is not None and block.epoch <= job.contours.epoch[contour]:
            emit_block(emitter, block)
            path = [] if block.moves else path
            block = next(blocks, None)
        progress.tell(emitter, k)
        print_contour(
            emitter, beads, contour, path, is_reversed=bool(actions.reversed[k]),
            entry=int(actions.entry[k]),
        )  # fmt: skip
        path = []
    for rest in ([block] if block is not None else []) + list(blocks):
        emit_block(emitter, rest)
    _finish(emitter)
    return emitter.text()


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
    if block.moves:
        emitter.bridge(begin.position)
    elif begin.position[2] > emitter.at[2] + NEAR_MM:
        x, y, _ = emitter.at
        emitter.travel([(x, y, begin.position[2])])
    emitter.owe(begin.owed, firmware=begin.firmware_retracted)
    left = emitter.owed - begin.owed
    emitter.set_state(begin.state)
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


def pause(emitter: Emitter, path: list[NDArray[np.float64]], seconds: float) -> None:
    """Retract, go where the plan waits and stand still there."""
    emitter.retract()
    _follow(emitter, path)
    emitter.dwell(seconds)


def print_contour(
    emitter: Emitter,
    beads: Beads,
    contour: int,
    path: list[NDArray[np.float64]],
    *,
    is_reversed: bool,
    entry: int,
    passed: Mapping[int, str] | None = None,
) -> None:
    """Travel to a contour and print it in the chosen traversal.

    Filament, feed and machine state go with each segment; an arc of the source is one again.
    `passed` has what is to be said, without a stop, where the head has come to points of the
    traversal, or to the end of the arc a point lies in; it does not wipe
    back over the last of them, for other heads may be there by then.
    """
    said = passed or {}
    plain = beads.plain[contour] and not entry and not said
    way = None if plain else traversal(beads.job.contours, contour, entry)
    if way is None:
        points, state = beads.points(contour, is_reversed=is_reversed), beads.state[contour]
    else:
        step = -1 if is_reversed else 1
        points = way.points[::step]
        state = int(emitter.document.point_state[way.rows[1:]][::step][0])
    begin: Point = tuple(points[0].tolist())
    emitter.set_state(state, before_travel=True)
    written = len(emitter.lines)
    _go(emitter, path, begin)
    first = emitter.top == -math.inf  # what the start code pushes belongs to the first bead
    if len(emitter.lines) == written and not (emitter.parted or first):
        emitter.say(SPLIT_MARK)  # above what is pushed on the spot, or that were the last bead's
    emitter.restart(float(emitter.document.owed[contour]))
    emitter.parted = False
    if way is None:
        emitter.set_state(state)
        ends = beads.ends(contour, is_reversed=is_reversed)
        left = beads.left(contour, is_reversed=is_reversed) if emitter.relative_e else []
        emitter.plain(ends, left, beads.feed[contour])
    else:
        _lay(emitter, beads.job, way, said, is_reversed=is_reversed)
    emitter.tail = points[max(said, default=0) :][::-1]
    emitter.top = max(emitter.top, beads.top[contour])


def _lay(
    emitter: Emitter, job: PrintJob, way: Rotated, said: Mapping[int, str], *, is_reversed: bool
) -> None:
    """Print along a traversal of a contour, segment by segment, and arc by arc where it has any."""
    step, document = -1 if is_reversed else 1, emitter.document
    points, filament = way.points[::step].tolist(), way.extrusion[1:][::step].tolist()
    feed = way.feed[1:][::step].tolist()
    state = document.point_state[way.rows[1:]][::step].tolist()
    arcs = arc_runs(document, job.contours, way, is_reversed=is_reversed)
    held, k, alike = -1, 0, _alike(feed, state)
    while k < len(feed):
        if state[k] != held:
            held = state[k]
            emitter.set_state(held)
        if arc := arcs.get(k):
            until = arc.end
            pushed = float(sum(filament[k:until]))
            emitter.arc(tuple(points[until]), arc.centre, arc.clockwise, feed[k], pushed)
        else:
            until = k + 1
            emitter.move(tuple(points[until]), feed[k], filament[k])
            if not said and not arcs and alike[k] > until:
                until = emitter.beads(points, filament, until, alike[k])
        for point in range(k + 1, until + 1) if said else ():
            if point in said:
                emitter.say(said[point])
        k = until


def _alike(feed: list[float], state: list[int]) -> list[int]:
    """Return for each segment up to where those after it have its feed and state."""
    if feed.count(feed[0]) == len(feed) and state.count(state[0]) == len(state):
        return [len(feed)] * len(feed)
    until = list(range(1, len(feed) + 1))
    for k in range(len(feed) - 2, -1, -1):
        if feed[k] == feed[k + 1] and state[k] == state[k + 1]:
            until[k] = until[k + 1]
    return until


def _go(emitter: Emitter, path: list[NDArray[np.float64]], begin: Point) -> None:
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


def _follow(emitter: Emitter, path: list[NDArray[np.float64]]) -> None:
    """Follow the planned path if it starts here."""
    way = [tuple(p) for part in path for p in part.tolist()]
    if way and math.dist(way[0], emitter.at) < NEAR_MM:
        emitter.travel(way[1:])


def _finish(emitter: Emitter) -> None:
    """Bring the controller to where the source ended, then write the postamble.

    The head stays above the print, for what was printed there is cold by now; only
    where the last bead ends as the source's does it stands on it, as there.
    """
    end = emitter.document.end
    emitter.hover(end.position)
    if abs(emitter.owed - end.owed) > 1e-6:  # be it but rounding: nothing is left for later
        emitter.retract()
    emitter.owe(end.owed, firmware=end.firmware_retracted)
    emitter.set_state(end.state)
    emitter.set_e(end.e)
    emitter.set_feed(end.feed)
    emitter.verbatim(b"".join(without_progress(emitter.document.postamble)))
