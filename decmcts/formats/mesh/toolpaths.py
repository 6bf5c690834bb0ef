"""From the regions of the layers to beads: skirt, perimeters, solid and sparse infill.

Rectilinear infill: parallel lines through a region, joined along its border.

With lines one bead apart the joints, which cover half of the border, fill just
what the lines' ends leave open there.

Ends that are neighbours on the border are joined in the order of the border,
each end once and never to a closed loop. (The nearest first, as some slicers do,
breaks zigzags where all gaps are alike but for rounding: twice as many pieces.)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from math import pi

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from decmcts.formats.mesh.options import Bed, SliceOptions
from decmcts.formats.mesh.sections import Layers, Shells
from decmcts.print.contours import Role

_OVERLAP = 0.15  # of the bead width, by which infill reaches into the perimeters
_MITRE_LIMIT = 2.0


@dataclass(frozen=True, slots=True)
class Bead:
    """One extrusion of a layer."""

    role: Role
    points: NDArray[np.float64]  # (k, 2) mm; a closed one ends where it starts


def layer_beads(
    layers: Layers, shells: Shells, number: int, options: SliceOptions
) -> Iterator[Bead]:
    """Yield the beads of one layer, island by island, each island's walls first."""
    islands = shapely.get_parts(layers.regions[number])
    if not len(islands):
        return
    height = float(layers.height[number])
    fill: list[list[Bead]] = [[] for _ in islands]
    tree = shapely.STRtree(islands)
    for bead in _fill(layers.regions[number], shells, number, height, options):
        fill[int(tree.nearest(shapely.Point(bead.points[0])))].append(bead)
    for i in _nearest_first(islands):
        yield from _perimeters(islands[i], height, options)
        yield from fill[i]


def _nearest_first(islands: NDArray[np.object_]) -> Iterator[int]:
    """Yield the islands' numbers, each nearest to the middle of the one before."""
    left = np.arange(len(islands))
    here = shapely.Point(0.0, 0.0)
    while len(left):
        chosen = int(np.argmin(shapely.distance(islands[left], here)))
        yield int(left[chosen])
        here = islands[left[chosen]].centroid
        left = np.delete(left, chosen)


def _inset(region: BaseGeometry, by: float) -> BaseGeometry:
    return region.buffer(-by, join_style="mitre", mitre_limit=_MITRE_LIMIT)


def _perimeters(island: BaseGeometry, height: float, options: SliceOptions) -> Iterator[Bead]:
    """Yield closed walls: inner ones first, then the external ones, or the other way."""
    depths = range(options.perimeters)
    for depth in depths if options.external_first else reversed(depths):
        wall = _inset(island, options.bead_width / 2.0 + depth * options.spacing(height))
        role = Role.PERIMETER if depth else Role.EXTERNAL_PERIMETER
        for part in shapely.get_parts(wall):
            for ring in [part.exterior, *part.interiors]:
                if ring.length > 2.0 * options.bead_width:
                    yield Bead(role, _from_seam(shapely.get_coordinates(ring)))


def _from_seam(ring: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a closed ring that starts at its rearmost corner, so that seams line up."""
    corners = ring[:-1]
    seam = int(np.lexsort((corners[:, 0], corners[:, 1]))[-1])
    rotated = np.roll(corners, -seam, axis=0)
    return np.concatenate([rotated, rotated[:1]])


def _fill(
    region: BaseGeometry, shells: Shells, number: int, height: float, options: SliceOptions
) -> Iterator[Bead]:
    """Yield the infill of a layer: solid, top, then sparse."""
    spacing, width = options.spacing(height), options.bead_width
    walls = width / 2.0 + (options.perimeters - 0.5) * spacing if options.perimeters else 0.0
    inner = _inset(region, walls)
    angle = pi / 4.0 if number % 2 else -pi / 4.0
    for role, area in _areas(inner, shells, number, width):
        sparse = role is Role.INFILL
        if area.is_empty or (sparse and options.density == 0.0):
            continue
        distance = spacing / options.density if sparse else spacing
        room = _inset(area, spacing / 2.0 - _OVERLAP * width)
        for line in zigzags(room, distance=distance, angle_rad=angle, shortest=width):
            yield Bead(role, line)


def _areas(
    inner: BaseGeometry, shells: Shells, number: int, width: float
) -> list[tuple[Role, BaseGeometry]]:
    """Divide the inside of a layer's walls by what it is filled with."""
    solid, top = shells.solid[number], shells.top[number]
    if solid.is_empty:
        return [(Role.INFILL, inner)]
    grown = solid.buffer(width).intersection(inner)  # solid beads need something to hold on to
    top = top.intersection(inner)
    return [
        (Role.SOLID_INFILL, grown.difference(top)),
        (Role.TOP_SOLID_INFILL, top),
        (Role.INFILL, inner.difference(grown)),
    ]


def skirt_beads(region: BaseGeometry, options: SliceOptions) -> Iterator[Bead]:
    """Yield the loops, the outer ones first, as many as the bed has room for.

    Where the bed is too small for the distance, loops come as near as two bead widths.
    """
    hull, width = shapely.convex_hull(region), options.bead_width
    room = _room(hull, options.bed) - width / 2.0
    nearest = min(options.skirt_distance, room - (options.skirts - 1) * width)
    if options.center is None:  # where the bed is, is not known
        nearest = options.skirt_distance
    if nearest < 2.0 * width:
        return
    for loop in reversed(range(options.skirts)):
        ring = hull.buffer(nearest + loop * width, quad_segs=8).exterior
        yield Bead(Role.SKIRT_BRIM, np.asarray(shapely.get_coordinates(ring)))


def _room(hull: BaseGeometry, bed: Bed) -> float:
    """Return how far the hull may grow before it leaves the bed, mm."""
    x0, y0, x1, y1 = hull.bounds
    return float(min(x0 - bed.low[0], y0 - bed.low[1], bed.high[0] - x1, bed.high[1] - y1))


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
