"""From the regions of the layers to beads: skirt, perimeters, solid and sparse infill."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import pi

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from decmcts.formats.mesh.infill import zigzags
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
        for chain in zigzags(room, distance=distance, angle_rad=angle, shortest=width):
            yield Bead(role, chain)


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
