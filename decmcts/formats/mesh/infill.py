"""Rectilinear infill: parallel lines through a region, joined along its border.

With lines one bead apart the joints, which cover half of the border, fill just
what the lines' ends leave open there.

Ends that are neighbours on the border are joined in the order of the border,
each end once and never to a closed loop. (The nearest first, as some slicers do,
breaks zigzags where all gaps are alike but for rounding: twice as many pieces.)
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

_LONGEST_JOINT = 3.0  # in line distances, along the border


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
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    turn = np.array([[cosine, -sine], [sine, cosine]])
    rotated = shapely.transform(region, lambda xy: xy @ turn)
    ends = _lines(rotated, distance)
    chains = _chains(ends, border_joints(ends, rotated, longest=_LONGEST_JOINT * distance))
    return [chain @ turn.T for chain in chains if _length(chain) >= shortest]


def _length(chain: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(np.diff(chain, axis=0), axis=1).sum())


def _lines(region: BaseGeometry, distance: float) -> NDArray[np.float64]:
    """Return the segments along X inside a region, (m, 2, 2)."""
    left, low, right, high = region.bounds
    rows = np.arange(np.ceil(low / distance), np.floor(high / distance) + 1) * distance
    spans = np.empty((len(rows), 2, 2))
    spans[:, 0, 0], spans[:, 1, 0] = left - 1.0, right + 1.0
    spans[:, :, 1] = rows[:, None]
    parts = shapely.get_parts(shapely.intersection(shapely.linestrings(spans), region))
    straight = parts[shapely.get_type_id(parts) == shapely.GeometryType.LINESTRING]
    ends = straight[shapely.length(straight) > 0.0]
    return np.asarray(shapely.get_coordinates(ends).reshape(-1, 2, 2))


def _chains(
    ends: NDArray[np.float64], joints: dict[int, InfillConnection]
) -> list[NDArray[np.float64]]:
    """Join segments to polylines; end 2 i + s is side s of segment i."""
    taken = np.zeros(len(ends), np.bool_)
    chains = []
    for first in range(2 * len(ends)):
        if first in joints or taken[first // 2]:
            continue  # chains begin at ends that are joined to nothing
        parts, at = [], first
        while True:
            taken[at // 2] = True
            other = at ^ 1
            parts += [ends[at // 2, at % 2][None], ends[other // 2, other % 2][None]]
            if other not in joints:
                break
            parts.append(joints[other].way)
            at = joints[other].to
        chains.append(np.concatenate(parts))
    return chains


@dataclass(frozen=True, slots=True)
class InfillConnection:
    """The way from one end of a line to the end `to` of another."""

    to: int
    way: NDArray[np.float64]  # (k, 2) corners of the border between, k may be 0


@dataclass(frozen=True, slots=True)
class _BorderStretch:
    """A stretch of border between two neighbouring ends."""

    length: float
    ring: int
    first: int  # ends
    last: int
    begin: float  # places along the ring, mm; may exceed its length
    end: float


def border_joints(
    ends: NDArray[np.float64], region: BaseGeometry, *, longest: float
) -> dict[int, InfillConnection]:
    """Return the joints by end; each is there from both of its ends.

    Parameters
    ----------
    ends : (m, 2, 2)
        The lines; end 2 i + s is side s of line i, on the border of `region`.
    region : BaseGeometry
        Polygonal, mm.
    longest : float
        Longest way along the border, mm.
    """
    if not len(ends):
        return {}
    rings = _rings(region)
    gaps = [gap for gap in _gaps(ends.reshape(-1, 2), rings) if gap.length <= longest]
    joints: dict[int, InfillConnection] = {}
    group = np.arange(len(ends))  # lines joined so far, union-find
    for gap in gaps:
        a, b = _root(group, gap.first // 2), _root(group, gap.last // 2)
        if a == b or gap.first in joints or gap.last in joints:
            continue
        group[a] = b
        way = _corners(shapely.get_coordinates(rings[gap.ring]), gap.begin, gap.end)
        joints[gap.first] = InfillConnection(gap.last, way)
        joints[gap.last] = InfillConnection(gap.first, way[::-1])
    return joints


def _rings(region: BaseGeometry) -> list[BaseGeometry]:
    polygons = shapely.get_parts(region)
    return list(chain.from_iterable([p.exterior, *p.interiors] for p in polygons))


def _gaps(points: NDArray[np.float64], rings: list[BaseGeometry]) -> list[_BorderStretch]:
    """Return the stretches between successive ends on each ring."""
    geometry = shapely.points(points)
    nearest = shapely.STRtree(rings).nearest(geometry)
    gaps = []
    for ring in np.unique(nearest).tolist():
        here = np.flatnonzero(nearest == ring)
        place = shapely.line_locate_point(rings[ring], geometry[here])
        order = np.argsort(place, kind="stable")
        place, here = place[order], here[order]
        ahead = np.append(place[1:], place[0] + rings[ring].length)
        following = np.roll(here, -1)
        rows = zip(here.tolist(), following.tolist(), place.tolist(), ahead.tolist(), strict=True)
        gaps += [_BorderStretch(e - b, ring, first, last, b, e) for first, last, b, e in rows]
    return gaps


def _root(group: NDArray[np.int64], line: int) -> int:
    """Return the representative of a line's group; mutates `group` by halving paths."""
    while group[line] != line:
        group[line] = group[group[line]]
        line = int(group[line])
    return line


def _corners(ring: NDArray[np.float64], begin: float, end: float) -> NDArray[np.float64]:
    """Return the corners strictly between two places along a closed ring."""
    steps = np.linalg.norm(np.diff(ring, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    twice = np.concatenate([along[:-1], along[:-1] + along[-1]])
    corners = np.concatenate([ring[:-1], ring[:-1]])
    return corners[(twice > begin + 1e-6) & (twice < end - 1e-6)]
