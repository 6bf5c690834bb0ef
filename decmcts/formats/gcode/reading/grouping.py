"""From moves to contours: which moves belong together, where the print begins and ends.

Bead sizes are found in `beads`, what lies between contours in `gaps`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.formats.gcode.controller.motion import Motion
from decmcts.formats.gcode.controller.state import Track
from decmcts.formats.gcode.reading.dots import beyond_retracted, laying_moves
from decmcts.formats.gcode.reading.grouping_kernels import group_moves
from decmcts.formats.gcode.text.lines import Lines

PURGE_MOVES = 20  # a start G-code extrudes no more often before its last set-up command
_SETUP_M = (820, 830, 1090, 1900)
_SETUP_G = (280, 290, 900, 210)


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
