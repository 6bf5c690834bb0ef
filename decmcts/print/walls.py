"""The one rule of which travels are retracted, and the outer walls it looks at.

A travel is retracted unless it is shorter than the source's least, or the source's slicer
leaves travels inside the part bare (Cura's combing, PrusaSlicer's
`only_retract_when_crossing_perimeters`) and this one stays inside: level, no longer than the
source's longest such travel, across no outer wall of its layer, its middle inside them.
A change to the next layer stays bare where the source leaves such changes bare: it climbs no
further than these do, and stays inside the walls of either layer. Travels, times and
writers ask here, the search its kernel (`decmcts.print.walls_kernels.bare`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.print.contours import Contours, Role
from decmcts.print.job import PrintJob, ProcessSettings
from decmcts.print.walls_kernels import (
    HEAD,
    LAYERS,
    PER_LAYER,
    SAME_Z_MM,
    Walls,
    bare_travels,
    list_cells,
)

CELL_MM = 2.0
MOST_CELLS = 4_000_000  # of all layers together: cells grow beyond
OUTER = (int(Role.EXTERNAL_PERIMETER), int(Role.OVERHANG_PERIMETER))


def no_walls() -> Walls:
    """Return the walls of a print that has none, or whose slicer does not look at them."""
    return _gridded(np.empty((0, 4)), np.empty(0))


def outer_walls(contours: Contours) -> Walls:
    """Return the outer walls of a print, loops closed over their seam; O(segments)."""
    outer = np.isin(contours.role, OUTER)
    owner = np.repeat(np.arange(len(contours)), np.diff(contours.offsets))
    points = contours.points
    along = np.flatnonzero(outer[owner[:-1]] & (owner[:-1] == owner[1:]))
    loops = np.flatnonzero(outer & contours.closed)
    begin = np.concatenate([points[along], contours.end[loops]])
    end = np.concatenate([points[along + 1], contours.start[loops]])
    level = np.abs(begin[:, 2] - end[:, 2]) <= SAME_Z_MM
    segments = np.concatenate([begin[level, :2], end[level, :2]], axis=1)
    return _gridded(segments, begin[level, 2])


def has_walls(walls: Walls) -> bool:
    """Tell whether a print has outer walls that are known."""
    return bool(walls[LAYERS] > 0.0)


def walls_for(job: PrintJob) -> Walls:
    """Return the walls travels of this job are judged by; none if its source has no such habit."""
    return outer_walls(job.contours) if job.settings.bare_inside_mm > 0.0 else no_walls()


def _gridded(segments: Floats, height: Floats) -> Walls:
    rounded = np.round(height, 6)
    z, layer = np.unique(rounded, return_inverse=True)
    layer = np.asarray(layer, np.int64).ravel()
    low, high = np.full((len(z), 2), np.inf), np.full((len(z), 2), -np.inf)
    for x, y in ((0, 1), (2, 3)):
        np.minimum.at(low, layer, segments[:, [x, y]])
        np.maximum.at(high, layer, segments[:, [x, y]])
    cell = CELL_MM
    while (cells := int((np.floor((high - low) / cell) + 1.0).prod(axis=1).sum())) > MOST_CELLS:
        cell *= 2.0
    size = np.floor((high - low) / cell) + 1.0
    first = np.concatenate([[0.0], np.cumsum(size.prod(axis=1))[:-1]])[: len(z)]
    layers = np.column_stack([z, low, size, first])
    begin = HEAD + PER_LAYER * len(z)  # of the cells' starts
    head = np.array([cell, len(z), begin, begin + cells + 1])
    walls = np.concatenate([head, layers.ravel()])
    counts = np.zeros(cells, np.int64)
    list_cells(segments, layer, walls, counts, False)
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    walls = np.concatenate([walls, starts, np.empty(4 * int(starts[-1]))])
    list_cells(segments, layer, walls, starts[:-1].copy(), True)
    return walls


def bare_pairs(
    walls: Walls,
    longest_mm: float,
    starts: Floats,
    goals: Floats,
    *,
    climb_mm: float = 0.0,
) -> Flags:
    """Return which travels (n, 3) to (n, 3) stay bare inside the part, straight as seen from above.

    Those that climb, by at most `climb_mm`, are inside if they are on the layers of both ends.
    """
    if longest_mm <= 0.0 or not len(starts):
        return np.zeros(len(starts), np.bool_)
    start, goal = (np.ascontiguousarray(p, np.float64) for p in (starts, goals))
    return np.asarray(bare_travels(walls, longest_mm, climb_mm, start, goal))


def retracted_paths(walls: Walls, settings: ProcessSettings, path: Floats, offsets: Ints) -> Flags:
    """Return which of the travels path[offsets[i]:offsets[i + 1]] are retracted, (n,).

    One that is lifted above both its ends is retracted from the source's least length up.
    """
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    first, last = offsets[:-1], np.maximum(offsets[1:] - 1, offsets[:-1])
    inside = np.minimum(last, max(len(path) - 1, 0))
    begin = np.minimum(first, max(len(path) - 1, 0))
    length = along[inside] - along[begin]
    due = (length > 0.0) & (length >= settings.retract_min_travel_mm)
    corners = np.diff(offsets)
    climb = np.flatnonzero(due & (corners == 3))
    climb = climb[_upright(path[begin[climb]], path[begin[climb] + 1], path[inside[climb]])]
    plain = np.concatenate([np.flatnonzero(due & (corners == 2)), climb])
    stays = bare_pairs(
        walls, settings.bare_inside_mm, path[begin[plain]], path[inside[plain]],
        climb_mm=settings.bare_climb_mm,
    )  # fmt: skip
    due[plain[stays]] = False
    bent = np.flatnonzero(due & (corners > 2) & (length <= settings.bare_inside_mm))
    begin, end = offsets[bent], offsets[bent + 1]
    due[bent[_bare_ways(walls, settings.bare_inside_mm, path, begin, end)]] = False
    return np.asarray(due)


def _bare_ways(walls: Walls, longest_mm: float, path: Floats, begin: Ints, end: Ints) -> Flags:
    """Return which ways path[begin[i]:end[i]] are level and stay inside the part leg by leg."""
    legs = end - begin - 1
    if not len(legs):
        return np.zeros(0, np.bool_)
    first = np.cumsum(legs) - legs
    at = np.arange(int(legs.sum())) + np.repeat(begin - first, legs)
    level = path[at, 2] == path[at + 1, 2]
    inside = level & bare_pairs(walls, longest_mm, path[at], path[at + 1])
    return np.asarray(np.logical_and.reduceat(inside, first))


def _upright(start: Floats, corner: Floats, goal: Floats) -> Flags:
    """Return which ways of three corners, (n, 3) each, climb straight up, then go level."""
    level = corner[:, 2] == goal[:, 2]
    return np.asarray(level & (start[:, :2] == corner[:, :2]).all(axis=1))


def retracts(
    walls: Walls, settings: ProcessSettings, way: Sequence[tuple[float, float, float]]
) -> bool:
    """Tell whether the one travel along `way` is retracted, as `retracted_paths` does."""
    length = sum(map(math.dist, way, way[1:]))
    if length <= 0.0 or length < settings.retract_min_travel_mm:
        return False
    if settings.bare_inside_mm <= 0.0:
        return True
    corners = [p for k, p in enumerate(way) if k == 0 or p != way[k - 1]]
    path, offsets = np.array(corners, np.float64), np.array([0, len(corners)])
    return bool(retracted_paths(walls, settings, path, offsets)[0])
