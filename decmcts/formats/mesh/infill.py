"""Rectilinear infill: parallel lines through a region, joined to zigzags.

Neighbouring lines are joined where the joint stays inside the region, as
slicers do; with lines one bead apart the joints fill the border exactly.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

_INSIDE_MM = 1e-3  # a joint along the border counts as inside
_LONGEST_JOINT = 2.5  # in line distances; longer ones would bridge gaps


def zigzags(
    region: BaseGeometry, *, distance: float, angle_rad: float, shortest: float
) -> list[NDArray[np.float64]]:
    """Return (k, 2) polylines that fill `region`.

    Parameters
    ----------
    region : BaseGeometry
        Polygonal; the lines' centres end at its border, mm.
    distance : float
        Distance of the lines, mm; they lie on one grid for all layers.
    angle_rad : float
        Direction of the lines.
    shortest : float
        Polylines shorter than this are left out, mm.
    """
    if region.is_empty:
        return []
    turn = np.array(
        [[np.cos(angle_rad), -np.sin(angle_rad)], [np.sin(angle_rad), np.cos(angle_rad)]]
    )
    turned = shapely.transform(region, lambda xy: xy @ turn)
    rows, ends = _lines(turned, distance)
    chains = _chains(rows, ends, turned, distance)
    long = [c for c in chains if np.linalg.norm(np.diff(c, axis=0), axis=1).sum() >= shortest]
    return [chain @ turn.T for chain in long]


def _lines(region: BaseGeometry, distance: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return row numbers (m,) and segments (m, 2, 2), left end first, by row then x."""
    left, low, right, high = region.bounds
    rows = np.arange(np.ceil(low / distance), np.floor(high / distance) + 1).astype(np.int64)
    spans = np.empty((len(rows), 2, 2))
    spans[:, 0, 0], spans[:, 1, 0] = left - 1.0, right + 1.0
    spans[:, :, 1] = rows[:, None] * distance
    cut = shapely.intersection(shapely.linestrings(spans), region)
    parts, source = shapely.get_parts(cut, return_index=True)
    straight = shapely.get_type_id(parts) == shapely.GeometryType.LINESTRING
    ends = shapely.get_coordinates(parts[straight]).reshape(-1, 2, 2)
    row = rows[source[straight]]
    ends = np.take_along_axis(ends, np.argsort(ends[:, :, :1], axis=1), axis=1)
    order = np.lexsort((ends[:, 0, 0], row))
    return row[order], ends[order]


def _chains(
    rows: NDArray[np.int64],
    ends: NDArray[np.float64],
    region: BaseGeometry,
    distance: float,
) -> list[NDArray[np.float64]]:
    """Join segments row by row, alternating the side."""
    joints = _joints(rows, ends, region, distance)
    taken = np.zeros(len(rows), np.bool_)
    chains = []
    for first in range(len(rows)):
        if taken[first]:
            continue
        at, side, chain = first, 1, []
        while at >= 0:
            taken[at] = True
            chain += [ends[at, 1 - side], ends[at, side]]
            at = next((b for b in joints.get((at, side), ()) if not taken[b]), -1)
            side = 1 - side
        chains.append(np.array(chain))
    return chains


def _joints(
    rows: NDArray[np.int64],
    ends: NDArray[np.float64],
    region: BaseGeometry,
    distance: float,
) -> dict[tuple[int, int], list[int]]:
    """Return, for each (segment, side), the segments of the next row a joint can reach."""
    below, above = _neighbours(rows, ends)
    near = region.buffer(_INSIDE_MM)
    shapely.prepare(near)
    found: dict[tuple[int, int], list[int]] = {}
    for side in (0, 1):
        spans = np.stack([ends[below, side], ends[above, side]], axis=1)
        short = np.linalg.norm(spans[:, 1] - spans[:, 0], axis=1) <= _LONGEST_JOINT * distance
        pairs = np.flatnonzero(short)
        inside = pairs[shapely.covers(near, shapely.linestrings(spans[pairs]))]
        for a, b in zip(below[inside].tolist(), above[inside].tolist(), strict=True):
            found.setdefault((a, side), []).append(b)
    return found


def _neighbours(
    rows: NDArray[np.int64], ends: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return pairs (a, b) of segments of successive rows that overlap along the row."""
    first = np.searchsorted(rows, rows + 1)
    count = np.searchsorted(rows, rows + 1, side="right") - first
    a = np.repeat(np.arange(len(rows)), count)
    b = first[a] + np.arange(len(a)) - np.repeat(np.cumsum(count) - count, count)
    overlap = (ends[a, 0, 0] <= ends[b, 1, 0]) & (ends[b, 0, 0] <= ends[a, 1, 0])
    return a[overlap], b[overlap]
