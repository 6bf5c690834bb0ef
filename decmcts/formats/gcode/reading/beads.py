"""Width, height, layer and role of each contour, from comments or from the moves.

Where the source says nothing, height is the step in z and width follows from
the filament: w = E·π(d/2)²/(L·h).
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.formats.gcode.controller.motion import Motion
from decmcts.formats.gcode.controller.state import Track
from decmcts.formats.gcode.dialects.dialect import role_of
from decmcts.formats.gcode.document import StateTable
from decmcts.formats.gcode.reading.grouping import Runs, beyond_retracted
from decmcts.formats.gcode.reading.grouping_kernels import MOVED, heaviest_label
from decmcts.formats.gcode.text.lines import Lines
from decmcts.print.contours import Role

DEFAULT_WIDTH_MM = 0.45
WIDTH_LIMITS_MM = (0.05, 3.0)  # beyond: E is not in mm of filament, or no bead
WIDEST_DOT_MM = 10.0
HEIGHT_LIMITS_MM = (0.01, 1.5)
_NUMBER = re.compile(r"[-+]?(?:\d++(?:\.\d++)?|\.\d++)")


@dataclass(frozen=True, slots=True)
class MeasuredBeads:
    """One value per contour, and per segment where it varies."""

    width: Floats  # (n,)
    height: Floats  # (n,)
    role: NDArray[np.int8]  # (n,)
    layer: Int32s  # (n,)
    move_width: Floats  # (k,) of the extruding moves, in order
    move_height: Floats  # (k,)


@dataclass(frozen=True, slots=True)
class Parsed:
    """A file as its lines, what they do, and its contours with their beads."""

    lines: Lines
    motion: Motion
    track: Track
    runs: Runs
    beads: MeasuredBeads


@dataclass(frozen=True, slots=True)
class _MoveShapes:
    """How the extruding moves run, (k,), and their contours, (n,)."""

    pushed: Floats  # (k,) mm of filament; upright and on the spot what stays there
    length: Floats  # (k,) mm
    across: Flags  # (k,) moves across the bed
    flat: Flags  # (n,) has moves across the bed: no dot, no pillar
    level: Floats  # (n,) z of its highest bead across the bed, else its lowest z


def measure_beads(motion: Motion, track: Track, runs: Runs, filament_mm: float) -> MeasuredBeads:
    """Return the bead of every contour and extruding move."""
    moves = np.flatnonzero(runs.contour >= 0)
    ids = runs.contour[moves]
    state = track.at(motion.line[moves])
    offsets = np.concatenate([[0], np.cumsum(np.bincount(ids, minlength=len(runs)))])
    shape = _shape_of(motion, runs, moves, offsets)
    height = _stated(track.table, "height")[state]
    step = _steps(shape.level, shape.flat)[ids]
    height = np.where(np.isnan(height) | (height <= 0), step, height)
    width = _stated(track.table, "width")[state]
    own = np.where(
        shape.flat, _mean_width(shape, height, filament_mm, ids),
        _round_width(shape, height, filament_mm, ids),
    )  # fmt: skip
    width = np.where(shape.flat[ids] & (width > 0.0), width, own[ids])
    roles = np.array([role_of(v) for v in track.table.values], np.int64)
    role = roles[track.table.column("type")][state]
    role = heaviest_label(offsets, shape.length, role, len(Role))
    return MeasuredBeads(
        np.maximum.reduceat(width, offsets[:-1]), np.maximum.reduceat(height, offsets[:-1]),
        role.astype(np.int8), _layers(motion, track, runs, shape.level), width, height,
    )  # fmt: skip


def _stated(table: StateTable, slot: str) -> Floats:
    """Return the number each state gives for a slot; NaN where it gives none."""
    numbers = np.full(len(table.values), np.nan)
    column = table.column(slot)
    for k in np.unique(column).tolist():
        text = table.values[k].split(":", 1)
        match = _NUMBER.search(text[1]) if len(text) == 2 else None
        if match:
            numbers[k] = float(match.group())
    return numbers[column]


def _steps(level: Floats, flat: Flags) -> Floats:
    """Return the distance of each contour's level to the next one below it, of `flat` ones."""
    level = np.round(level, 4)
    levels = np.unique(level[flat] if flat.any() else level)
    step = np.diff(levels, prepend=0.0)
    usual = step[(step >= HEIGHT_LIMITS_MM[0]) & (step <= HEIGHT_LIMITS_MM[1])]
    middle = float(np.median(usual)) if len(usual) else 0.2
    own = level - np.append(0.0, levels)[np.searchsorted(levels, level)]
    return np.where((own < HEIGHT_LIMITS_MM[0]) | (own > HEIGHT_LIMITS_MM[1]), middle, own)


def _shape_of(motion: Motion, runs: Runs, moves: Ints, offsets: Ints) -> _MoveShapes:
    delta = np.diff(motion.points, axis=0)[moves]
    across = np.hypot(delta[:, 0], delta[:, 1]) > MOVED
    z = motion.points[moves + 1, 2]
    flat = np.logical_or.reduceat(across, offsets[:-1])
    highest = np.maximum.reduceat(np.where(across, z, -np.inf), offsets[:-1])
    lowest = np.minimum(np.minimum.reduceat(z, offsets[:-1]), motion.points[runs.first, 2])
    surplus = beyond_retracted(motion)[moves]
    pushed = np.where(across, motion.extrusion[moves], surplus)
    length = np.linalg.norm(delta, axis=1)
    return _MoveShapes(pushed, length, across, flat, np.where(flat, highest, lowest))


def _mean_width(shape: _MoveShapes, height: Floats, filament_mm: float, ids: Ints) -> Floats:
    """Return the mean width of each contour across the bed from its filament, (n,)."""
    n, area = len(shape.flat), np.pi * filament_mm**2 / 4.0
    volume = np.bincount(ids, np.where(shape.across, shape.pushed, 0.0), n) * area
    side = np.bincount(ids, np.where(shape.across, shape.length * height, 0.0), n)
    width = np.divide(volume, side, out=np.zeros(n), where=side > 0)
    low, high = WIDTH_LIMITS_MM
    sound = (width >= low) & (width <= high)
    usual = float(np.median(width[sound])) if sound.any() else DEFAULT_WIDTH_MM
    return np.where(sound, width, usual)


def _round_width(shape: _MoveShapes, height: Floats, filament_mm: float, ids: Ints) -> Floats:
    """Return the diameter of contours that go nowhere across the bed, (n,).

    Their filament is a cylinder, from a bead's height below the lowest point up to the
    highest: so high a vertical bead is, and a dot no higher than its bead.
    """
    n = len(shape.flat)
    volume = np.bincount(ids, shape.pushed, n) * np.pi * filament_mm**2 / 4.0
    climb = np.bincount(ids, shape.length, n)
    bead = np.bincount(ids, height, n) / np.maximum(np.bincount(ids, minlength=n), 1)
    width = np.sqrt(np.maximum(4.0 * volume / (np.pi * np.where(climb > 0.0, climb, bead)), 0.0))
    return np.clip(width, WIDTH_LIMITS_MM[0], WIDEST_DOT_MM)


def _layers(motion: Motion, track: Track, runs: Runs, level: Floats) -> Int32s:
    """Return the layer of each contour: markers above it, else its level."""
    if len(track.layer_lines):
        above = np.searchsorted(track.layer_lines, motion.line[runs.first])
        return np.unique(above, return_inverse=True)[1].astype(np.int32)
    return np.unique(np.round(level, 4), return_inverse=True)[1].astype(np.int32)
