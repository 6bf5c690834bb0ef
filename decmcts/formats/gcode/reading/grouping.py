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

from decmcts.arrays import Flags, Floats, Ints
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


def laying_moves(motion: Motion, track: Track, surplus: Floats, parts: Ints, first: int) -> Flags:
    """Tell which moves lay down material, (m,); linear in their number.

    Parameters
    ----------
    surplus : (m,) as `beyond_retracted` returns it
    parts : (m,) number of the stretch between barriers that each move is in
    first : the first move of the print
    """
    delta = np.diff(motion.points, axis=0)
    across = delta[:, 0] ** 2 + delta[:, 1] ** 2 > MOVED**2
    climbs = ~across & (np.abs(delta[:, 2]) > MOVED)  # or falls
    pushes = motion.extrusion > PUSHED
    pushes[:first] = False
    bead = pushes & across
    given = pushes & ~across & (surplus > DOT_MM)
    if not given.any():
        return bead
    pays = motion.extrusion > surplus + DOT_MM  # back what was retracted
    upright = given & climbs
    turns = across | (motion.extrusion < -PUSHED)
    at_once = _next_is_bead(bead, turns | climbs, parts)
    lowered = _next_is_bead(bead, turns | upright, parts)
    restart = pays & (surplus <= RESTART_MM)
    restart |= pays & lowered & (surplus <= NEAR_RESTART_MM)
    given &= ~restart & (climbs | ~at_once)
    rises = upright & ~pays & (delta[:, 2] > 0.0)
    return np.asarray(bead | (given & _printed(motion, track, given, bead | rises)))


def _next_is_bead(bead: Flags, turns: Flags, parts: Ints) -> Flags:
    """Tell behind which moves the next one that turns to something else is a bead, (m,)."""
    m = len(bead)
    rows = np.where(turns, np.arange(m), m)
    following = np.append(np.minimum.accumulate(rows[::-1])[::-1][1:], m)
    found = np.minimum(following, m - 1)
    return np.asarray((following < m) & bead[found] & (parts[found] == parts))


def _printed(motion: Motion, track: Track, given: Flags, sure: Flags) -> Flags:
    """Tell where a dot or vertical bead belongs to the print, (m,).

    Not in tool changes, between barriers or in end code: there the source's lines stand word
    for word. `sure` are the moves that lay down material in any case.
    """
    m = len(given)
    rows = np.arange(m)
    before = np.maximum.accumulate(np.where(sure, rows, -1))
    behind = np.minimum.accumulate(np.where(sure, rows, m)[::-1])[::-1]
    part = np.searchsorted(track.stops(), motion.line)
    fed = np.searchsorted(track.stops(REFILLS), motion.line)
    a, b = np.maximum(before, 0), np.minimum(behind, m - 1)
    above, below = part == part[a], part == part[b]
    leading = (before < 0) & (below | (behind == m))
    if not len(track.layer_lines):
        places = np.unique(np.round(motion.points[1:][given & leading], 3), axis=0)
        leading &= len(places) >= FEW_DOTS
    ends = (before >= 0) & above & (behind == m)
    amid = (before >= 0) & (behind < m) & (above | below) & (fed[a] == fed[b])
    return np.asarray((amid | leading | ends) & _by_slicer(motion, track))


def _by_slicer(motion: Motion, track: Track) -> Flags:
    """Tell which moves stand neither in a tool change, nor in custom G-code, nor in G91, (m,)."""
    table, line = track.table, motion.line
    roles = np.array([role_of(v) for v in table.values], np.int64)
    printed = ~np.isin(roles[table.column("type")], _NOT_PRINTED)[track.at(line)]
    absolute = motion.modes[line, RELATIVE_XYZ] == 0
    return np.asarray(printed & absolute & ~track.in_section(line))


@dataclass(frozen=True, slots=True)
class Runs:
    """The contours of a file as runs of moves."""

    contour: Ints  # (m,) contour of each move, -1 for none
    first: Ints  # (n,) first move of each contour
    last: Ints  # (n,) last move of each contour
    body: int  # line the print begins at: above it is start G-code

    def __len__(self) -> int:
        return len(self.first)


def find_runs(lines: Lines, motion: Motion, track: Track) -> Runs:
    """Return the contours of the print.

    Raises InputError when nothing is extruded.
    """
    body = _first_line(lines, motion, track)
    first = int(motion.before[body])
    walls = np.sort(np.concatenate([track.stops(), track.splits]))
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
    setup = lines.are("M", _SETUP_M) | lines.are("G", _SETUP_G)
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

    Raises InputError when the print extrudes in relative coordinates or sets X, Y or Z anew.
    """
    lays, inside = np.zeros(len(lines), np.bool_), np.zeros(len(lines), np.bool_)
    lays[motion.line[runs.contour >= 0]] = True
    inside[motion.line[runs.first[0]] : motion.line[runs.last[-1]]] = True
    lines.refuse_first(
        lays & (motion.modes[:, RELATIVE_XYZ] == 1),
        "the print extrudes in relative coordinates (G91)",
        "set the slicer to absolute positions",
    )
    two_places = "a position means two places then; remove it from the custom G-code"
    origin = motion.placed & (lines.code == 920)
    system = lines.are("G", range(530, 600))
    lines.refuse_first(
        inside & origin, "G92 moves the origin of X, Y or Z during the print", two_places
    )
    lines.refuse_first(
        inside & system, "a work coordinate system changes during the print", two_places
    )
    area = motion.extruder[:, 2]
    changes = np.append(False, area[1:] != area[:-1])
    lines.refuse_first(inside & changes, "M200 changes what E means in the print")
