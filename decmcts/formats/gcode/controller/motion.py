"""All moves of a file as arrays: what the controller would do, in order.

Arcs are opened into chords whose distance from the arc is at most
`CHORD_ERROR_MM`; E is shared by length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.gcode import moves as kernels
from decmcts._kernels.gcode import scan
from decmcts.formats.files.bounds import LARGEST_FILAMENT_MM, LARGEST_MM
from decmcts.formats.gcode.controller.refused import refuse_meanings
from decmcts.formats.gcode.text.lines import Lines

CHORD_ERROR_MM = 0.005


@dataclass(frozen=True, slots=True)
class Motion:
    """Moves and the controller's state after each line."""

    points: NDArray[np.float64]  # (m + 1, 3)
    extrusion: NDArray[np.float64]  # (m,) filament, mm
    feed: NDArray[np.float64]  # (m,) mm/s
    line: NDArray[np.int64]  # (m,) index of the source line, from 0
    before: NDArray[np.int64]  # (n_lines + 1,) moves above each line
    modes: NDArray[np.int16]  # (n_lines, N_MODES) after each line
    extruder: NDArray[np.float64]  # (n_lines, 3) E value, retraction owed, E cross-section
    placed: NDArray[np.bool_]  # (n_lines,) G92 or G28 set an axis here
    decimals: tuple[int, int, int]  # xy, e and feed as the source writes them


def interpret(lines: Lines) -> Motion:
    """Return what the lines do.

    Raises
    ------
    InputError
        On inches, an arc without a centre, a polar or rotated frame, a fourth axis, or several
        motion systems.
    """
    refuse_meanings(lines)
    n = len(lines)
    moves, line = np.zeros((n, 5)), np.full(n, n, np.int64)
    modes, extruder = np.zeros((n, kernels.N_MODES), np.int16), np.zeros((n, 3))
    placed = np.zeros(n, np.bool_)
    kernels.interpret(
        lines.letter, lines.code, lines.values, modes, extruder, moves, line, placed,
        _counts_relative(lines),
    )  # fmt: skip
    m = int(np.searchsorted(line, n))
    moves, line = moves[:m], line[:m]
    before = np.searchsorted(line, np.arange(n + 1)).astype(np.int64)
    points = np.concatenate([np.zeros((1, 3)), moves[:, :3]])
    pushed, feed = np.ascontiguousarray(moves[:, 3]), np.ascontiguousarray(moves[:, 4])
    motion = Motion(points, pushed, feed, line, before, modes, extruder, placed, _decimals(lines))
    _refuse_far(lines, motion)
    curved = np.isin(lines.code[line], (20, 30))
    return _open_arcs(lines, motion) if bool(curved.any()) else motion


def _counts_relative(lines: Lines) -> bool:
    """Guess how E counts where no M82 or M83 says: absolute E does not fall while moving."""
    if ((lines.letter == 77) & np.isin(lines.code, (820, 830))).any():
        return False
    drawn = (lines.letter == 71) & (lines.code <= 30) & ~np.isnan(lines.values[:, scan.E])
    drawn &= ~np.isnan(lines.values[:, : scan.E]).all(axis=1)
    e = lines.values[drawn, scan.E]
    return bool(len(e) > 1 and (np.diff(e) < 0).mean() > 0.1)


def _decimals(lines: Lines) -> tuple[int, int, int]:
    xy = int(max(lines.decimals[: scan.E].max(), 3))
    e = int(np.clip(lines.decimals[scan.E], 5, 8))
    curved = (lines.letter == 71) & np.isin(lines.code, (20, 30))
    if curved.any():
        e = min(e + 2, 8)  # a short chord's share of E must not become nothing
    return min(xy, 6), e, min(int(lines.decimals[scan.F]), 6)


def _refuse_far(lines: Lines, motion: Motion) -> None:
    far = np.flatnonzero((np.abs(motion.points[1:]) > LARGEST_MM).any(axis=1))
    if len(far):
        what = f"relative moves that leave ±{LARGEST_MM:g} mm"
        raise lines.refuse(int(motion.line[far[0]]), what)
    much = np.flatnonzero(np.abs(motion.extrusion) > LARGEST_FILAMENT_MM)
    if len(much):
        what = f"more than {LARGEST_FILAMENT_MM:g} mm of filament in one move"
        raise lines.refuse(int(motion.line[much[0]]), what)


def _open_arcs(lines: Lines, motion: Motion) -> Motion:
    starts, ends = motion.points[:-1], motion.points[1:]
    arcs = np.zeros((len(ends), 3))
    count = kernels.plan_arcs(
        starts, ends, motion.line, lines.code, lines.values, CHORD_ERROR_MM, arcs
    )
    if len(wrong := np.flatnonzero(count == 0)):
        raise lines.refuse(int(motion.line[wrong[0]]), "an arc that no circle fits")
    total = int(count.sum())
    grid = 10.0 ** np.asarray(motion.decimals[:2], float)
    points, extrusion = np.zeros((total, 3)), np.zeros(total)
    source = np.zeros(total, np.int64)
    kernels.open_arcs(starts, ends, motion.extrusion, arcs, count, grid, points, extrusion, source)
    chords_before = np.concatenate([[0], np.cumsum(count)])
    return Motion(
        np.concatenate([np.zeros((1, 3)), points]), extrusion, motion.feed[source],
        motion.line[source], chords_before[motion.before], motion.modes, motion.extruder,
        motion.placed, motion.decimals,
    )  # fmt: skip
