"""Width, height, layer and role of each contour, from comments or from the moves.

Where the source says nothing, height is the step in z and width follows from
the filament: w = E·π(d/2)²/(L·h).
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.gcode.contours import heaviest_label
from decmcts.formats.gcode.controller.motion import Motion
from decmcts.formats.gcode.controller.state import Track
from decmcts.formats.gcode.dialects.roles import role_of
from decmcts.formats.gcode.document import StateTable
from decmcts.formats.gcode.reading.grouping import Runs
from decmcts.print.contours import Role

DEFAULT_WIDTH_MM = 0.45
WIDTH_LIMITS_MM = (0.05, 3.0)  # beyond: E is not in mm of filament, or no bead
HEIGHT_LIMITS_MM = (0.01, 1.5)
_NUMBER = re.compile(r"[-+]?\d*\.?\d+")


@dataclass(frozen=True, slots=True)
class Beads:
    """One value per contour, and per segment where it varies."""

    width: NDArray[np.float64]  # (n,)
    height: NDArray[np.float64]  # (n,)
    role: NDArray[np.int8]  # (n,)
    layer: NDArray[np.int32]  # (n,)
    move_width: NDArray[np.float64]  # (k,) of the extruding moves, in order
    move_height: NDArray[np.float64]  # (k,)


def measure_beads(motion: Motion, runs: Runs, track: Track, *, filament_mm: float) -> Beads:
    """Return the bead of every contour and extruding move."""
    moves = np.flatnonzero(runs.contour >= 0)
    ids = runs.contour[moves]
    state = track.at(motion.line[moves])
    offsets = np.concatenate([[0], np.cumsum(np.bincount(ids, minlength=len(runs)))])
    length = np.linalg.norm(np.diff(motion.points, axis=0)[moves], axis=1)
    z = motion.points[moves + 1, 2]
    height = _stated(track.table, "height")[state]
    step = _steps(np.maximum.reduceat(z, offsets[:-1]))[ids]
    height = np.where(np.isnan(height) | (height <= 0), step, height)
    width = _stated(track.table, "width")[state]
    inferred = _width_of(motion.extrusion[moves], length, height, filament_mm, ids, len(runs))
    width = np.where(np.isnan(width) | (width <= 0), inferred, width)
    roles = np.array([role_of(v) for v in track.table.values], np.int64)
    column = _column(track.table, "type")
    role = heaviest_label(offsets, length, roles[column][state], len(Role))
    return Beads(
        np.maximum.reduceat(width, offsets[:-1]), np.maximum.reduceat(height, offsets[:-1]),
        role.astype(np.int8), _layers(motion, runs, track, z, offsets), width, height,
    )  # fmt: skip


def _column(table: StateTable, slot: str) -> NDArray[np.int64]:
    if slot not in table.slots:
        return np.zeros(len(table.rows), np.int64)
    return table.rows[:, table.slots.index(slot)].astype(np.int64)


def _stated(table: StateTable, slot: str) -> NDArray[np.float64]:
    """Return the number each state gives for a slot; NaN where it gives none."""
    numbers = np.full(len(table.values), np.nan)
    for k in np.unique(_column(table, slot)).tolist():
        text = table.values[k].split(":", 1)
        match = _NUMBER.search(text[1]) if len(text) == 2 else None
        if match:
            numbers[k] = float(match.group())
    return numbers[_column(table, slot)]


def _steps(top: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of each contour's z to the next level below it."""
    levels, index = np.unique(np.round(top, 4), return_inverse=True)
    step = np.diff(levels, prepend=0.0)
    usual = step[(step >= HEIGHT_LIMITS_MM[0]) & (step <= HEIGHT_LIMITS_MM[1])]
    middle = float(np.median(usual)) if len(usual) else 0.2
    bad = (step < HEIGHT_LIMITS_MM[0]) | (step > HEIGHT_LIMITS_MM[1])
    return np.where(bad, middle, step)[index]


def _width_of(
    pushed: NDArray[np.float64],
    length: NDArray[np.float64],
    height: NDArray[np.float64],
    filament_mm: float,
    ids: NDArray[np.int64],
    n: int,
) -> NDArray[np.float64]:
    """Return the mean width of each contour from its filament, per move."""
    area = np.pi * filament_mm**2 / 4.0
    volume = np.bincount(ids, pushed, n) * area
    side = np.bincount(ids, length * height, n)
    width = np.divide(volume, side, out=np.zeros(n), where=side > 0)
    low, high = WIDTH_LIMITS_MM
    sound = (width >= low) & (width <= high)
    usual = float(np.median(width[sound])) if sound.any() else DEFAULT_WIDTH_MM
    return np.where(sound, width, usual)[ids]


def _layers(
    motion: Motion,
    runs: Runs,
    track: Track,
    z: NDArray[np.float64],
    offsets: NDArray[np.int64],
) -> NDArray[np.int32]:
    """Return the layer of each contour: markers above it, else its level."""
    if len(track.layer_lines):
        above = np.searchsorted(track.layer_lines, motion.line[runs.first])
        _, dense = np.unique(above, return_inverse=True)
        return dense.astype(np.int32)
    top = np.round(np.maximum.reduceat(z, offsets[:-1]), 4)
    return np.unique(top, return_inverse=True)[1].astype(np.int32)
