"""From the regions of the layers to beads: perimeters, solid and sparse infill."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import pi

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from decmcts.formats.mesh.infill import zigzags
from decmcts.formats.mesh.options import SliceOptions
from decmcts.formats.mesh.sections import Layers
from decmcts.print.contours import Role

_OVERLAP = 0.15  # of the bead width, by which infill reaches into the perimeters
_MITRE_LIMIT = 2.0


@dataclass(frozen=True, slots=True)
class Bead:
    """One extrusion of a layer."""

    role: Role
    points: NDArray[np.float64]  # (k, 2) mm; a closed one ends where it starts


def layer_beads(layers: Layers, number: int, options: SliceOptions) -> Iterator[Bead]:
    """Yield the beads of one layer, island by island, each island's walls first."""
    islands = shapely.get_parts(layers.regions[number])
    solid, top = _solid_areas(layers, number, options)
    at = np.zeros(2)
    for island in _nearest_first(list(islands), at):
        height = float(layers.height[number])
        yield from _perimeters(island, height, options)
        yield from _fill(island, solid, top, number, height, options)


def _nearest_first(islands: list[BaseGeometry], at: NDArray[np.float64]) -> Iterator[BaseGeometry]:
    """Yield islands, each nearest to the middle of the one before."""
    left = list(islands)
    here = shapely.Point(at)
    while left:
        chosen = min(range(len(left)), key=lambda i: float(left[i].distance(here)))
        island = left.pop(chosen)
        here = island.centroid
        yield island


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
    turned = np.roll(corners, -seam, axis=0)
    return np.concatenate([turned, turned[:1]])


def _solid_areas(
    layers: Layers, number: int, options: SliceOptions
) -> tuple[BaseGeometry, BaseGeometry]:
    """Return the area to fill solidly and the part of it that nothing covers."""
    region = layers.regions[number]
    n = len(layers.regions)
    low, high = number - options.bottom_layers, number + options.top_layers
    if low < 0 or high >= n:
        solid = region
    else:
        solid = region
        inside = _common(layers.regions[low : high + 1], region)
        solid = (
            region.difference(inside).buffer(options.bead_width)
            if inside is not region
            else shapely.MultiPolygon()
        )
    above = layers.regions[number + 1] if number + 1 < n else shapely.MultiPolygon()
    top = shapely.MultiPolygon() if above is region else region.difference(above)
    return solid, top if options.top_layers else shapely.MultiPolygon()


def _common(regions: tuple[BaseGeometry, ...], own: BaseGeometry) -> BaseGeometry:
    """Return the area common to all, `own` itself where all are the same object."""
    common = own
    for region in {id(r): r for r in regions}.values():
        if region is not own:
            common = common.intersection(region)
    return common


def _fill(
    island: BaseGeometry,
    solid: BaseGeometry,
    top: BaseGeometry,
    number: int,
    height: float,
    options: SliceOptions,
) -> Iterator[Bead]:
    spacing, width = options.spacing(height), options.bead_width
    walls = width / 2.0 + (options.perimeters - 0.5) * spacing if options.perimeters else 0.0
    inner = _inset(island, walls)
    angle = pi / 4.0 if number % 2 else -pi / 4.0
    areas = (
        (Role.SOLID_INFILL, solid.difference(top), spacing),
        (Role.TOP_SOLID_INFILL, top.intersection(solid), spacing),
        (
            Role.INFILL,
            shapely.difference(inner, solid),
            spacing / options.density if options.density else 0.0,
        ),
    )
    for role, area, distance in areas:
        if area.is_empty or distance == 0.0:
            continue
        room = _inset(inner.intersection(area), spacing / 2.0 - _OVERLAP * width)
        for chain in zigzags(room, distance=distance, angle_rad=angle, shortest=width):
            yield Bead(role, chain)
