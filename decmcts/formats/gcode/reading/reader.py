"""From a G-code file to a print job and the document that keeps its text.

Composes the modules beside it; the meaning of lines is in `dialect`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.errors import InputError
from decmcts.formats.gcode.controller.limits import commanded, state_limits, stated_limits
from decmcts.formats.gcode.controller.motion import CHORD_ERROR_MM, interpret
from decmcts.formats.gcode.controller.state import track_state
from decmcts.formats.gcode.document import NO_ARC, Cursor, GcodeDocument, Motions, StateTable
from decmcts.formats.gcode.reading.beads import Parsed, measure_beads
from decmcts.formats.gcode.reading.edges import state_edges
from decmcts.formats.gcode.reading.gaps import (
    Blocks,
    cursor_at,
    due_at_begins,
    find_blocks,
    gaps_of,
    net_before,
    net_behind,
    travel_states,
)
from decmcts.formats.gcode.reading.grouping import (
    REFILLS,
    find_runs,
    refuse_unsafe,
    with_dots_apart,
)
from decmcts.formats.gcode.reading.habits import (
    filament_diameter,
    infer_settings,
    with_bare_travels,
)
from decmcts.formats.gcode.text.lines import above_comments, command_of, split_lines
from decmcts.formats.gcode.text.source_text import load_text
from decmcts.formats.slicers.known import either, together
from decmcts.print.contours import Contours, Role
from decmcts.print.job import PrintJob, ProcessSettings
from decmcts.print.motion import limits_of
from decmcts.print.motion_kernels import PRINTING

PRIMED_MM = 0.01  # filament pushed beyond what is owed
_PACKED = re.compile(r"\.gz$|(?<=\.gcode)\.3mf$", re.I)
_SIGNS = together("signs")
_SLICERS = re.compile(rb"(%b)[ ,]*(?:Version )?([\w.+-]*)" % either("signs"))


@dataclass(frozen=True, slots=True)
class Ending:
    """What a file hands over to its end G-code."""

    cursor: Cursor
    states: StateTable
    laid: tuple[float, float, float]  # where the last bead ends, mm
    top: float  # z of the highest bead, mm


def _parse(path: Path | str, plate: int | None = None, text: bytes | None = None) -> Parsed:
    text = load_text(path, plate) if text is None else text
    lines = split_lines(text, path)
    motion = with_dots_apart(interpret(lines))
    track = track_state(lines, motion)
    runs = find_runs(lines, motion, track)
    refuse_unsafe(lines, motion, runs)
    beads = measure_beads(motion, track, runs, filament_diameter(text))
    return Parsed(lines, motion, track, runs, beads)


def read_gcode(
    path: Path | str, plate: int | None = None, *, text: bytes | None = None
) -> tuple[PrintJob, GcodeDocument]:
    """Read a G-code file, plain or packed; of a .gcode.3mf the G-code of a `plate`.

    Where a `text` is given it is read in place of the file's own, and kept with the document.

    Contours have chords at most 0.005 mm from an arc; the document keeps the arcs.
    Extrusions above the first layer marker (purge lines) belong to the preamble.

    Raises InputError when the file is damaged, or holds something that cannot be put in another
    order safely; the message names the line.
    """
    job, document = _print_of(_parse(path, plate, text), plate)
    return job, document if text is None else replace(document, text=text)


def read_written(
    path: Path | str, document: GcodeDocument, plate: int | None = None
) -> tuple[PrintJob, GcodeDocument, Motions, Ending]:
    """Read a file made from `document`, its moves, and what it leaves to the end code, at once.

    Raises InputError as `read_gcode`, and when the file does not end with the end G-code of
    `document`.
    """
    parsed = _parse(path, plate)
    ending = _ending(parsed, document)
    job, ours = _print_of(parsed, plate)
    return job, ours, ours.moves, ending


def _ending(parsed: Parsed, document: GcodeDocument) -> Ending:
    due = [code for row in document.postamble.split(b"\n") if (code := command_of(row))]
    rows = parsed.lines.text.rstrip().split(b"\n")
    line = len(rows)
    for wanted in reversed(due):  # command by command: comments may have come or gone
        line = next((k for k in range(line - 1, -1, -1) if command_of(rows[k])), -1)
        if line < 0 or command_of(rows[line]) != wanted:
            raise InputError("the end G-code is not the source's", path=parsed.lines.path)
    line = above_comments(rows.__getitem__, line, document.postamble)
    motion, runs = parsed.motion, parsed.runs
    x, y, z = motion.points[runs.last[-1] + 1].tolist()
    top = float(motion.points[1:, 2][runs.contour >= 0].max())
    cursor = cursor_at(parsed, line, owed=-net_before(parsed, line))
    return Ending(cursor, parsed.track.table, (x, y, z), top)


def _print_of(parsed: Parsed, plate: int | None) -> tuple[PrintJob, GcodeDocument]:
    lines, motion, runs = parsed.lines, parsed.motion, parsed.runs
    towers = parsed.track.in_section(motion.line[runs.first])  # they keep their place in it
    towers |= parsed.beads.role == Role.WIPE_TOWER
    edges, one_way = state_edges(parsed)
    gaps = gaps_of(parsed)
    blocks = find_blocks(parsed, gaps, edges=edges, towers=towers)
    contours, point_state, point_arc = _contours(parsed, blocks, one_way)
    settings, habits = infer_settings(parsed, gaps)
    settings = with_bare_travels(lines.text, contours, settings, gaps.pulled)
    top = _preamble_end(parsed)
    bottom = int(motion.line[runs.last[-1]]) + 1
    start = cursor_at(parsed, top, owed=net_behind(parsed, top))
    first = int(motion.line[runs.first[0]])
    document = GcodeDocument(
        lines.path, lines.span(0, top), lines.span(bottom, len(lines)),
        b"\r\n" if lines.text.count(b"\r\n") * 2 > len(lines) else b"\n",
        start, cursor_at(parsed, bottom, owed=0.0), blocks.blocks,
        replace(parsed.track.table, travel=travel_states(parsed)), point_state,
        due_at_begins(gaps, blocks.parted),
        bool(motion.modes[first, 1]), float(motion.extruder[first, 2]), motion.decimals, habits,
        point_arc, motion.arcs, plate, _motions_of(parsed),
    )  # fmt: skip
    name = _PACKED.sub("", Path(lines.path).name).rsplit(".", 1)[0]
    stated = stated_limits(lines.text)
    accelerations = commanded(parsed.track.table, PRINTING, stated)[point_state]
    unstated = bool(np.isnan(accelerations).all())
    states = state_limits(parsed.track.table, stated, stated)
    limits = limits_of(states[int(parsed.track.at(first))])
    if not unstated:
        limits = replace(limits, acceleration=float(np.nanmedian(accelerations)))
    if settings.travel_acceleration > 0.0:
        limits = replace(limits, travel_acceleration=settings.travel_acceleration)
    job = PrintJob(
        name, contours, settings, blocks.barriers, _slicer(lines.text),
        _notes(parsed, blocks, settings, point_arc), limits, None if unstated else accelerations,
        _refills(parsed, blocks),
    )  # fmt: skip
    return job, document


def _refills(parsed: Parsed, blocks: Blocks) -> tuple[int, ...]:
    """Return the epochs that begin where the nozzle is fed anew, or may be, or stood still long."""
    lines = parsed.track.stops(REFILLS)
    next_one = np.searchsorted(parsed.motion.line[parsed.runs.first], lines)
    within = (next_one > 0) & (next_one < len(blocks.epoch))
    fed = np.union1d(blocks.epoch[next_one[within]], blocks.epoch[blocks.held])
    return tuple(fed.tolist())


def read_motions(path: Path | str, plate: int | None = None) -> Motions:
    """Read every move of a G-code file, the start and the end included.

    Raises InputError as `read_gcode`.
    """
    return _motions_of(_parse(path, plate))


def _motions_of(parsed: Parsed) -> Motions:
    motion, contour = parsed.motion, parsed.runs.contour
    width, height = np.zeros(len(contour)), np.zeros(len(contour))
    width[contour >= 0] = parsed.beads.move_width
    height[contour >= 0] = parsed.beads.move_height
    return Motions(
        motion.points, motion.extrusion, motion.feed, motion.line + 1, contour, width, height,
        motion.placed[motion.line], motion.arc, motion.arcs,
        motion.tool(), motion.withdrawn,
    )  # fmt: skip


def _preamble_end(parsed: Parsed) -> int:
    """Return the first line of the print: below its marker and below any barrier there.

    Where the nozzle is primed after that, the first bead begins the print: what
    is pushed before it belongs to the start, not to a retraction.
    """
    motion, runs = parsed.motion, parsed.runs
    first = int(motion.line[runs.first[0]])
    early = [line for line in parsed.track.barriers if runs.body <= line < first]
    top = max([runs.body, *(line + 1 for line in early)])
    pushed = float(motion.extrusion[motion.before[top] : runs.first[0]].sum())
    owed = float(motion.extruder[top - 1, 1]) if top else 0.0
    return first if abs(pushed - owed) > PRIMED_MM else top


def _contours(parsed: Parsed, blocks: Blocks, one_way: Flags) -> tuple[Contours, Int32s, Int32s]:
    """Return the contours, and the state and the arc of each of their points."""
    motion, runs, beads = parsed.motion, parsed.runs, parsed.beads
    moves = np.flatnonzero(runs.contour >= 0)
    ids, n = runs.contour[moves], len(runs)
    sizes = np.bincount(ids, minlength=n) + 1
    offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    slot = np.arange(len(moves)) + ids + 1  # one point more per contour
    points = np.empty((offsets[-1], 3))
    extrusion, feed = np.zeros(offsets[-1]), np.zeros(offsets[-1])
    state, arc = np.zeros(offsets[-1], np.int32), np.full(offsets[-1], NO_ARC, np.int32)
    points[offsets[:-1]] = motion.points[runs.first]
    points[slot] = motion.points[moves + 1]
    extrusion[slot], feed[slot] = motion.extrusion[moves], motion.feed[moves]
    state[slot], arc[slot] = parsed.track.at(motion.line[moves]), motion.arc[moves]
    state[offsets[:-1]] = state[offsets[:-1] + 1]
    rounding_mm = 0.5 * 10.0 ** -motion.decimals[0]
    reversible = _reversible(points, extrusion, offsets, beads.role, rounding_mm)
    contours = Contours(
        points=points, offsets=offsets, extrusion=extrusion, feed=feed, width=beads.width,
        height=beads.height, role=beads.role, closed=_closed(points, offsets, beads.width),
        layer=beads.layer, tool=motion.tool(runs.first).astype(np.int16),
        reversible=reversible & ~blocks.tied & ~one_way,
        epoch=blocks.epoch, line=(motion.line[runs.first] + 1).astype(np.int32),
    )  # fmt: skip
    state.setflags(write=False)
    arc.setflags(write=False)
    return contours, state, arc


def _closed(points: Floats, offsets: Ints, width: Floats) -> Flags:
    """Tell which contours end within a bead width of their start after a longer way."""
    gap = np.linalg.norm(points[offsets[1:] - 1] - points[offsets[:-1]], axis=1)
    step = np.linalg.norm(np.diff(points, axis=0, prepend=points[:1]), axis=1)
    step[offsets[:-1]] = 0.0
    length = np.add.reduceat(step, offsets[:-1])
    return np.asarray((gap <= width) & (np.diff(offsets) >= 4) & (length > 4.0 * width))


def _reversible(
    points: Floats,
    extrusion: Floats,
    offsets: Ints,
    role: NDArray[np.int8],
    rounding_mm: float,
) -> Flags:
    """Tell which contours give the same bead reversed.

    Not ironing (it pushes material ahead of itself), not slopes (vase, scarf
    seams: one end lies on the other), not ramps of flow at both ends of a seam,
    not what ends with a segment of no length once rounded, which as the first would
    be lost.
    Beads of varying width keep the filament of each segment, so they may be reversed;
    so may contours followed by a wipe, which is made again along the end they
    then have.
    """
    begin = offsets[:-1]
    z = points[:, 2]
    flat = np.maximum.reduceat(z, begin) - np.minimum.reduceat(z, begin) < 1e-6
    step = np.linalg.norm(np.diff(points, axis=0, prepend=points[:1]), axis=1)
    step[begin] = 0.0
    flow = np.divide(extrusion, step, out=np.zeros_like(step), where=step > 1e-6)
    mean = np.add.reduceat(extrusion, begin) / np.maximum(np.add.reduceat(step, begin), 1e-9)
    ramp = (flow[begin + 1] < 0.6 * mean) & (flow[offsets[1:] - 1] < 0.6 * mean)
    ramp &= np.diff(offsets) > 3
    pointless = step[offsets[1:] - 1] < rounding_mm
    return np.asarray(flat & ~ramp & ~pointless & (role != Role.IRONING))


def _slicer(text: bytes) -> str:
    match = _SLICERS.search(text[:20000]) or _SLICERS.search(text[-40000:])
    if match is None:
        return ""
    name, version = (part.decode("ascii", "replace") for part in match.groups())
    return f"{_SIGNS[name]} {version}".strip()


def _notes(
    parsed: Parsed,
    blocks: Blocks,
    settings: ProcessSettings,
    point_arc: Int32s,
) -> tuple[str, ...]:
    notes, span = [], parsed.motion.line[[parsed.runs.first[0], parsed.runs.last[-1]]]
    for lines, what in (
        (parsed.track.repeats, "temperatures that are in force already"),
        (parsed.track.idle, "commands that end an object where none is open"),
    ):
        again = lines[np.searchsorted(lines, span[0]) :]
        if len(again := again[again < span[1]]):
            text = parsed.lines.raw(int(again[0])).decode("utf-8", "replace").split(";", 1)[0]
            notes.append(
                f"{what} are left out: {len(again)}, first {text.strip()} (line {again[0] + 1})"
            )
    if curved := len(np.unique(point_arc[point_arc != NO_ARC])):
        notes.append(
            f"{curved} arc{'s' * (curved != 1)}, planned as chords at most {CHORD_ERROR_MM} mm "
            "from them and written as arcs"
        )
    if len(blocks.blocks):
        n = len(blocks.blocks)
        notes.append(f"{n} place{'s' * (n != 1)} nothing is moved across")
    if settings.bare_inside_mm > 0.0:
        changes = " and layer changes" if settings.bare_climb_mm > 0.0 else ""
        notes.append(
            f"level travels{changes} of up to {settings.bare_inside_mm:.1f} mm that cross no outer "
            "wall stay unretracted, as the source leaves them"
        )
    return tuple(notes)
