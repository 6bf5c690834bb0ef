"""From moves to contours: which moves belong together, where the print begins and ends.

Bead sizes are found in `beads`, what lies between contours in `gaps`.

Material is laid by beads across the bed, by vertical beads, and by dots. A dot is filament pushed
where the nozzle stands, before it goes on without a bead: braille, spot welds, rivets. A vertical
bead is pushed while the nozzle climbs: pillars. Both look like the end of a retraction, so only
what goes beyond what the tool has retracted counts. What a bead follows from the same place is no
dot: it belongs to that bead, as a restart distance does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.formats.gcode.controller.motion import Motion
from decmcts.formats.gcode.controller.moves_kernels import RELATIVE_XYZ
from decmcts.formats.gcode.controller.state import Track
from decmcts.formats.gcode.dialects.dialect import role_of
from decmcts.formats.gcode.reading.grouping_kernels import MOVED, PUSHED, group_moves
from decmcts.formats.gcode.text.lines import Lines
from decmcts.print.contours import Role

DOT_MM = 1e-3  # of filament beyond what is retracted; less is rounding
RESTART_MM = 0.2  # a surplus up to this, pushed with what was retracted, restarts the flow,
NEAR_RESTART_MM = 1.0  # or up to this, where the nozzle only comes down to a bead then
FEW_DOTS = 2  # places with dots before the first bead; at fewer the nozzle is primed
REFILLS = frozenset({"tool change", "filament change", "pause"})
_NOT_PRINTED = (Role.WIPE_TOWER, Role.CUSTOM)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
PURGE_MOVES = 20  # a start G-code extrudes no more often before its last set-up command
_SETUP_M = (820, 830, 1090, 1900)
_SETUP_G = (280, 290, 900, 210)


def beyond_retracted(motion: Motion) -> Floats:
    """Return what each move pushes beyond what its tool has retracted before it, (m,) mm."""
    line, pushed = motion.line, motion.extrusion
    owed = np.where(line > 0, motion.extruder[np.maximum(line - 1, 0), 1], 0.0)
    total = np.concatenate([[0.0], np.cumsum(pushed)])[:-1]
    within = total - total[motion.before[line]]  # pushed by moves of the same line before it
    return np.asarray(pushed - np.maximum(owed - within, 0.0))


def with_dots_apart(motion: Motion) -> Motion:
    """Return the moves with each push on the spot cut in two where it pays back, and lays a dot.

    The first of the two pays back what was retracted; both are of one line.
    """
    surplus = beyond_retracted(motion)
    still = (np.diff(motion.points, axis=0) == 0.0).all(axis=1)
    paid = motion.extrusion - surplus
    cut = np.flatnonzero(still & (surplus > RESTART_MM) & (paid > DOT_MM))
    if not len(cut):
        return motion
    taken = np.insert(np.arange(len(still)), cut, cut)
    extrusion = motion.extrusion[taken]
    at = cut + np.arange(len(cut))
    extrusion[at], extrusion[at + 1] = paid[cut], surplus[cut]
    return replace(
        motion, points=np.insert(motion.points, cut + 1, motion.points[cut + 1], axis=0),
        extrusion=extrusion, feed=motion.feed[taken], line=motion.line[taken],
        before=motion.before + np.searchsorted(cut, motion.before), arc=motion.arc[taken],
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _MoveKinds:
    """What the moves of a file do, each (m,)."""

    across: Bools
    climbs: Bools  # or falls
    bead: Bools  # across, with filament, in the print
    upright: Bools  # up or down, with filament beyond what was retracted, in the print
    still: Bools  # neither, with such filament, in the print
    pays: Bools  # what is pushed pays back what was retracted


def laying_moves(motion: Motion, track: Track, surplus: Floats, parts: Ints, first: int) -> Bools:
    """Tell which moves lay down material, (m,); linear in their number.

    Parameters
    ----------
    surplus : (m,) as `beyond_retracted` returns it
    parts : (m,) number of the stretch between barriers that each move is in
    first : the first move of the print
    """
    moves = _moves_of(motion, surplus, first)
    given = moves.upright | moves.still
    if not given.any():
        return moves.bead
    turns = moves.across | (motion.extrusion < -PUSHED)
    at_once = _next_is_bead(moves.bead, turns | moves.climbs, parts)
    lowered = _next_is_bead(moves.bead, turns | (moves.upright), parts)
    restart = moves.pays & (surplus <= RESTART_MM)
    restart |= moves.pays & lowered & (surplus <= NEAR_RESTART_MM)
    given &= ~restart & ~(moves.still & at_once)
    rises = moves.upright & ~moves.pays & (motion.points[1:, 2] > motion.points[:-1, 2])
    return np.asarray(moves.bead | (given & _printed(motion, track, given, moves.bead | rises)))


def _moves_of(motion: Motion, surplus: Floats, first: int) -> _MoveKinds:
    delta = np.diff(motion.points, axis=0)
    across = delta[:, 0] ** 2 + delta[:, 1] ** 2 > MOVED**2
    climbs = ~across & (np.abs(delta[:, 2]) > MOVED)
    pushes = motion.extrusion > PUSHED
    pushes[:first] = False
    given = pushes & ~across & (surplus > DOT_MM)
    return _MoveKinds(
        across, climbs, pushes & across, given & climbs, given & ~climbs,
        motion.extrusion > surplus + DOT_MM,
    )  # fmt: skip


def _next_is_bead(bead: Bools, turns: Bools, parts: Ints) -> Bools:
    """Tell behind which moves the next one that turns to something else is a bead, (m,)."""
    m = len(bead)
    rows = np.where(turns, np.arange(m), m)
    following = np.append(np.minimum.accumulate(rows[::-1])[::-1][1:], m)
    found = np.minimum(following, m - 1)
    return np.asarray((following < m) & bead[found] & (parts[found] == parts))


def _printed(motion: Motion, track: Track, given: Bools, sure: Bools) -> Bools:
    """Tell where a dot or vertical bead belongs to the print, (m,).

    Not in tool changes, between barriers or in end code: there the source's lines stand word
    for word. `sure` are the moves that lay down material in any case.
    """
    m = len(given)
    rows = np.arange(m)
    before = np.maximum.accumulate(np.where(sure, rows, -1))
    behind = np.minimum.accumulate(np.where(sure, rows, m)[::-1])[::-1]
    walls = np.sort(np.fromiter(track.barriers, np.int64, len(track.barriers)))
    refills = np.array(
        sorted(line for line, reason in track.barriers.items() if reason in REFILLS), np.int64
    )
    part = np.searchsorted(walls, motion.line)
    fed = np.searchsorted(refills, motion.line)
    a, b = np.maximum(before, 0), np.minimum(behind, m - 1)
    above, below = part == part[a], part == part[b]
    leading = (before < 0) & (below | (behind == m))
    leading &= bool(len(track.layer_lines)) or _several(motion, given & leading)
    ends = np.where(before >= 0, above, True) & (behind == m)
    amid = (before >= 0) & (behind < m) & (above | below) & (fed[a] == fed[b])
    allowed = amid | leading | (ends & (before >= 0))
    return np.asarray(allowed & _by_slicer(motion, track))


def _several(motion: Motion, dots: Bools) -> bool:
    """Tell whether these moves stand at several places."""
    places = np.unique(np.round(motion.points[1:][dots], 3), axis=0)
    return len(places) >= FEW_DOTS


def _by_slicer(motion: Motion, track: Track) -> Bools:
    """Tell which moves stand neither in a tool change, nor in custom G-code, nor in G91, (m,)."""
    table, line = track.table, motion.line
    roles = np.array([role_of(v) for v in table.values], np.int64)
    role = np.zeros(len(table.rows), np.int64)
    if "type" in table.slots:
        role = roles[table.rows[:, table.slots.index("type")]]
    inside = ~np.isin(role, _NOT_PRINTED)[track.at(line)]
    inside &= motion.modes[line, RELATIVE_XYZ] == 0
    if len(track.sections):
        k = np.maximum(np.searchsorted(track.sections[:, 0], line) - 1, 0)
        inside &= (line < track.sections[k, 0]) | (line >= track.sections[k, 1])
    return np.asarray(inside)


@dataclass(frozen=True, slots=True)
class Parsed:
    """A file as its lines, what they do, and its contours."""

    lines: Lines
    motion: Motion
    track: Track
    runs: Runs


@dataclass(frozen=True, slots=True)
class Runs:
    """The contours of a file as runs of moves."""

    contour: NDArray[np.int64]  # (m,) contour of each move, -1 for none
    first: NDArray[np.int64]  # (n,) first move of each contour
    last: NDArray[np.int64]  # (n,) last move of each contour
    body: int  # line the print begins at: above it is start G-code

    def __len__(self) -> int:
        return len(self.first)


def find_runs(lines: Lines, motion: Motion, track: Track) -> Runs:
    """Return the contours of the print.

    Raises
    ------
    InputError
        When nothing is extruded.
    """
    body = _first_line(lines, motion, track)
    first = int(motion.before[body])
    walls = np.sort(
        np.concatenate([np.fromiter(track.barriers, np.int64, len(track.barriers)), track.splits])
    )
    parts = np.searchsorted(walls, motion.line)
    surplus = beyond_retracted(motion)
    lays = laying_moves(motion, track, surplus, parts, first)
    contour = group_moves(
        motion.points, motion.extrusion, surplus, lays, parts, first, len(motion.extrusion)
    )
    n = int(contour.max(initial=-1)) + 1
    if n == 0:
        raise InputError(
            "nothing is extruded in this file",
            path=lines.path,
            advice="is it G-code of a filament printer, exported whole?",
        )
    inside = np.flatnonzero(contour >= 0)
    ids = contour[inside]
    starts = np.flatnonzero(np.diff(ids, prepend=-1))
    last = inside[np.append(starts[1:], len(ids)) - 1]
    return Runs(contour, inside[starts], last, body)


def _first_line(lines: Lines, motion: Motion, track: Track) -> int:
    """Return the line of the first layer marker, or the end of the set-up commands."""
    if len(track.layer_lines):
        return int(track.layer_lines[0])
    setup = ((lines.letter == 77) & np.isin(lines.code, _SETUP_M)) | (
        (lines.letter == 71) & np.isin(lines.code, _SETUP_G)
    )
    given = motion.extrusion > 0
    across = given & (np.diff(motion.points[:, :2], axis=0) != 0).any(axis=1)
    pushes = np.flatnonzero(across if across.any() else given)
    limit = len(lines)
    if len(pushes):
        limit = int(motion.line[pushes[min(PURGE_MOVES, len(pushes) // 2)]])
    early = np.flatnonzero(setup[:limit])
    return int(early[-1]) + 1 if len(early) else 0


def refuse_unsafe(lines: Lines, motion: Motion, runs: Runs) -> None:
    """Refuse what cannot be put in another order safely.

    Raises
    ------
    InputError
        When the print extrudes in relative coordinates or sets X, Y or Z anew.
    """
    begin, end = int(motion.line[runs.first[0]]), int(motion.line[runs.last[-1]])
    inside = runs.contour >= 0
    relative = np.flatnonzero((motion.modes[motion.line, 0] == 1) & inside)
    if len(relative):
        raise lines.refuse(
            int(motion.line[relative[0]]),
            "the print extrudes in relative coordinates (G91)",
            "set the slicer to absolute positions",
        )
    placed = np.flatnonzero(motion.placed[begin:end] & (lines.code[begin:end] == 920)) + begin
    if len(placed):
        raise lines.refuse(
            int(placed[0]),
            "G92 moves the origin of X, Y or Z during the print",
            "a position means two places then; remove it from the custom G-code",
        )
    offsets = (lines.letter == 71) & (lines.code >= 530) & (lines.code < 600)
    framed = np.flatnonzero(offsets[begin:end]) + begin
    if len(framed):
        raise lines.refuse(
            int(framed[0]),
            "a work coordinate system changes during the print",
            "a position means two places then; remove it from the custom G-code",
        )
    volumetric = motion.extruder[begin:end, 2]
    if len(changed := np.flatnonzero(np.diff(volumetric) != 0)):
        raise lines.refuse(int(changed[0]) + begin + 1, "M200 changes what E means in the print")
