"""Which parts of each layer are solid because the outside is near above or below."""

from __future__ import annotations

from dataclasses import dataclass

import shapely
from shapely.geometry.base import BaseGeometry

from decmcts.formats.mesh.sections import Layers

NOTHING = shapely.MultiPolygon()


@dataclass(frozen=True, slots=True)
class Shells:
    """Areas by layer, mm."""

    solid: tuple[BaseGeometry, ...]  # (n,) to be filled without gaps, the top included
    top: tuple[BaseGeometry, ...]  # (n,) that no layer covers


def find_shells(layers: Layers, top_layers: int, bottom_layers: int) -> Shells:
    """Return the solid areas.

    A place is solid when one of the `top_layers` layers from its own upwards is
    not covered there by the next, or likewise downwards. Each layer is compared
    with its two neighbours only; a shell is the union of such differences.
    """
    regions = layers.regions
    n = len(regions)
    covered = [*regions[1:], NOTHING]
    carried = [NOTHING, *regions[:-1]]
    up = [_exposed(a, b) for a, b in zip(regions, covered, strict=True)]
    down = [_exposed(a, b) for a, b in zip(regions, carried, strict=True)]
    solid = []
    for i, region in enumerate(regions):
        first_below = max(0, i - bottom_layers + 1)
        near = up[i : i + top_layers] + down[first_below : i + 1 if bottom_layers else first_below]
        solid.append(_within(near, region))
    return Shells(tuple(solid), tuple(up) if top_layers else (NOTHING,) * n)


def _exposed(region: BaseGeometry, other: BaseGeometry) -> BaseGeometry:
    if region is other:
        return NOTHING
    return region if other.is_empty else region.difference(other)


def _within(parts: list[BaseGeometry], region: BaseGeometry) -> BaseGeometry:
    if any(part is region for part in parts):
        return region
    some = [part for part in parts if not part.is_empty]
    return shapely.union_all(some).intersection(region) if some else NOTHING
