"""Where a nozzle may go: over the bed and where the source goes, and not below the bed.

Machines differ in where their coordinates begin, so where on the bed a print lies
is its slicer's business. What is judged: no print is larger than the bed (purge lines,
role CUSTOM, are drawn beside it on purpose); nothing goes lower than the bed, z = 0, or
than the source goes; and nothing leaves the rectangle round bed, source and park.

Below is a one-head file as the judge sees it: moves, and beads that grow with them.
"""

from __future__ import annotations

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.formats.gcode import Motions
from decmcts.formats.gcode.controller.motion import Motion
from decmcts.print.contours import Contours, Role
from decmcts.print.job import DEFAULT_TRAVEL, ProcessSettings
from decmcts.print.machine import Machine
from decmcts.print.plan import ActionKind, HeadActions
from sim.content.inventory import Segments, move_segments
from sim.content.laid import laying_rows
from sim.content.paths import SAME_MM, describe
from sim.faults import Fault, FaultKind, listed, listed_rows
from sim.replay.shapes import Beads

SIZE_MM = 0.01  # slicers round coordinates
FEED_SHARE = 0.01  # F words are rounded
UNKNOWN_FEED = ProcessSettings().retract_feed  # mm/s, of filament where a source shows none
DOT_MM = 0.01  # of filament; less is what a bead too short for its coordinates leaves


def check_extent(
    contours: Contours,
    source: Contours | None,
    all_actions: tuple[HeadActions, ...],
    machine: Machine,
) -> list[Fault]:
    """Check the paths of a plan; without a source none may go below z = 0."""
    known = contours if source is None else source
    low, high = _reached(known.points, machine)
    low[2] = min(0.0, float(low[2])) if source is not None else 0.0
    lines: list[str] = []
    for actions, head in zip(all_actions, machine.heads, strict=True):
        park = np.array(head.park)
        least, most = np.minimum(low, park), np.maximum(high, park)
        most[2] = np.inf
        owner = np.repeat(np.arange(len(actions)), np.diff(actions.path_offsets))
        bad = _beyond(actions.path, least, most)
        # a head that parks below the bed may go there, not print there
        bad |= (actions.kind[owner] == ActionKind.PRINT) & (actions.path[:, 2] < low[2] - SAME_MM)
        first = np.unique(owner[bad], return_index=True)[1]
        lines += [
            f"{describe(actions, int(owner[i]))} goes {_where(actions.path[i], least)}"
            for i in np.flatnonzero(bad)[first].tolist()
        ]
    return listed(FaultKind.OUT_OF_REACH, [*_too_large(contours, machine), *lines])


def check_file_extent(motions: Motions, source: Motions, machine: Machine) -> list[Fault]:
    """Check the moves of a file."""
    low, high = _reached(source.points, machine)
    low[2], high[2] = min(0.0, float(low[2])), np.inf
    rows = moving(motions)
    bad = rows[_beyond(motions.points[rows + 1], low, high)]
    return listed_rows(
        FaultKind.OUT_OF_REACH, bad,
        lambda i: f"line {motions.line[i]} goes {_where(motions.points[i + 1], low)}",
    )  # fmt: skip


def check_file_feeds(motions: Motions, source: Motions, machine: Machine) -> list[Fault]:
    """Check the feeds of moves that lay nothing; those of beads are compared bead by bead.

    Filament alone is pushed and pulled within the range of feeds in which the source does that.
    No travel is faster than the source's fastest, or than the machine's usual travels, and none is
    slower than the source's slowest: a hot nozzle that creeps over the print spoils it. No move is
    made at feed 0 that the source does not make so: a file's first moves may come before any F, and
    those are the source's.
    """
    theirs = {tuple(row) for row in _feedless(source)[1].tolist()}
    ours = zip(*(column.tolist() for column in _feedless(motions)), strict=True)
    new = [i for i, row in ours if tuple(row) not in theirs]
    faults = listed(FaultKind.FEED, [f"line {motions.line[i]} moves at feed 0" for i in new])
    faults += check_filament_feeds(motions, source)
    if len(due := np.asarray(source.feed)[_travels(source)]):
        usual = machine.limits.travel_feed
        low, high = min(float(due.min()), usual, DEFAULT_TRAVEL), max(float(due.max()), usual)
        faults += _outside(motions, _travels(motions), low, high, "travels")
    return faults


def check_filament_feeds(motions: Motions | Motion, source: Motions, above: int = 0) -> list[Fault]:
    """Check the feeds of moves of filament alone; `above` is the number of lines above line 0."""
    if not len(due := np.asarray(source.feed)[_filament_alone(source)]):
        return []
    low, high = min(float(due.min()), UNKNOWN_FEED), max(float(due.max()), UNKNOWN_FEED)
    rows = _filament_alone(motions)
    return _outside(motions, rows, low, high, "moves filament alone", above)


def _outside(
    motions: Motions | Motion, rows: Ints, low: float, high: float, what: str, above: int = 0
) -> list[Fault]:
    feed = np.asarray(motions.feed)[rows]
    bad = (feed < low * (1.0 - FEED_SHARE)) | (feed > high * (1.0 + FEED_SHARE))
    due = f"{low:.3f} to {high:.3f} are due"
    return listed_rows(
        FaultKind.FEED, rows[bad],
        lambda i: f"line {motions.line[i] + above} {what} at {motions.feed[i]:.3f} mm/s; {due}",
    )  # fmt: skip


def _filament_alone(motions: Motions | Motion) -> Ints:
    """Return the moves of filament on the spot, but for what rounding leaves of a bead."""
    still = (np.diff(motions.points, axis=0) == 0.0).all(axis=1)
    pushed = np.abs(np.asarray(motions.extrusion)) > DOT_MM
    return np.flatnonzero(still & pushed & (np.asarray(motions.feed) > 0.0))


def _travels(motions: Motions) -> Ints:
    """Return the moves that go somewhere and lay nothing, wipes among them."""
    rows = moving(motions)
    goes = (motions.points[rows] != motions.points[rows + 1]).any(axis=1)
    goes &= (np.asarray(motions.extrusion)[rows] <= 0.0) & (np.asarray(motions.feed)[rows] > 0.0)
    return np.asarray(rows[goes])


def _feedless(motions: Motions) -> tuple[Ints, Floats]:
    rows = moving(motions)
    start, end = motions.points[rows], motions.points[rows + 1]
    fed = np.asarray(motions.feed)[rows] > 0
    kept = ~fed & (start != end).any(axis=1)
    return rows[kept], np.round(np.hstack([start, end])[kept], 3)


def _reached(points: Floats, machine: Machine) -> tuple[Floats, Floats]:
    """Return the corners of the box round the bed and these points."""
    bed = np.array([[*machine.bed_min, 0.0], [*machine.bed_max, 0.0]])
    both = np.vstack([points, bed]).T.copy()  # an axis a row, which is ten times as fast
    return both.min(axis=1), both.max(axis=1)


def _beyond(points: Floats, low: Floats, high: Floats) -> Flags:
    beyond = np.zeros(len(points), np.bool_)
    for axis, least, most in zip(points.T.copy(), low - SAME_MM, high + SAME_MM, strict=True):
        beyond |= (axis < least) | (axis > most)
    return beyond


def _where(point: Floats, low: Floats) -> str:
    x, y, z = point.tolist()
    what = "below the bed" if z < low[2] - SAME_MM else "beyond bed, print and park"
    return f"{what}, to ({x:.2f}, {y:.2f}, {z:.2f})"


def _too_large(contours: Contours, machine: Machine) -> list[str]:
    size = np.diff(contours.offsets)
    printed = np.repeat(contours.role != Role.CUSTOM, size)
    if not printed.any():
        return []
    half = np.repeat(contours.width / 2.0, size)[printed]
    xy = contours.points[printed, :2].T.copy()
    span = (xy + half).max(axis=1) - (xy - half).min(axis=1)
    bed = np.subtract(machine.bed_max, machine.bed_min)
    if (span <= bed + SIZE_MM).all():
        return []
    return [f"the print is {span[0]:.1f} x {span[1]:.1f} mm, the bed {bed[0]:g} x {bed[1]:g} mm"]


def laying_moves(motions: Motions) -> Ints:
    """Return the moves that lay down material."""
    known = np.asarray(motions.contour) >= 0
    return laying_rows(motions.points, np.asarray(motions.extrusion), tools_of(motions), known)


def tools_of(motions: Motions) -> Ints:
    """Return the tool in use, (m,)."""
    n = len(motions.line)
    return np.zeros(n, np.int64) if motions.tool is None else np.asarray(motions.tool, np.int64)


def segments_of(motions: Motions, laid: Ints) -> Segments:
    """Return the moves that lay down material, `laying_moves`, as the inventory compares them."""
    return move_segments(
        motions.points, motions.extrusion, motions.feed, np.asarray(motions.line, np.int64), laid
    )


def moves_array(motions: Motions) -> Floats:
    """Return every move, (m, 6)."""
    return np.hstack([motions.points[:-1], motions.points[1:]])


def moving(motions: Motions) -> Ints:
    """Return the moves whose path is known: all but homing and G92.

    A move at feed 0 (`F0`) is among them: firmware makes it at the feed before.
    """
    known = np.asarray(motions.feed) > 0
    return np.nonzero(known if motions.placed is None else ~np.asarray(motions.placed))[0]


def beads_of(motions: Motions, laid: Ints, match: Ints) -> Beads:
    """Return the beads of a file with the first move that may meet each.

    Only contours count: a purge line of the start code has no stated size, and the start code
    is not reordered. A contour may slope over itself where it runs as in the source. In another
    traversal each of its segments is material for the next ones. `match` is for each of the
    `laying_moves` the place of its segment in the source, (n,).
    """
    contour = np.asarray(motions.contour, np.int64)[laid]
    rows, match, contour = (values[contour >= 0] for values in (laid, match, contour))
    if not len(rows):
        raise ValueError("no contour in the file")
    begins = np.concatenate([[True], contour[1:] != contour[:-1]])
    run = np.cumsum(begins) - 1
    last = np.concatenate([np.nonzero(begins)[0][1:] - 1, [len(rows) - 1]])
    forward = np.concatenate([[True], (np.diff(match) == 1) | begins[1:]])
    as_sliced = np.logical_and.reduceat(forward, np.nonzero(begins)[0])[run]
    since = np.where(as_sliced, rows[last[run]], rows) + 1
    width, height = np.asarray(motions.width)[rows], np.asarray(motions.height)[rows]
    line = np.asarray(motions.line, np.int64)[rows]
    return Beads(motions.points[rows], motions.points[rows + 1], width, height, since, line)
