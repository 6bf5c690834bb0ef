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

    A place is solid unless all of the `top_layers` layers above and the
    `bottom_layers` layers below have it too. Intersecting one layer after the
    other is several times faster than uniting what each leaves bare: such
    slivers lie side by side, the slow case of every overlay.
    """
    regions = layers.regions
    solid = tuple(
        _bare(region, _reach(regions, i, top_layers, bottom_layers))
        for i, region in enumerate(regions)
    )
    if not top_layers:
        return Shells(solid, (NOTHING,) * len(regions))
    covers = [*regions[1:], NOTHING]
    top = tuple(_bare(region, [above]) for region, above in zip(regions, covers, strict=True))
    return Shells(solid, top)


def _reach(
    regions: tuple[BaseGeometry, ...], layer: int, top_layers: int, bottom_layers: int
) -> list[BaseGeometry]:
    """Return the different regions a place must be in to be inside."""
    low, high = layer - bottom_layers, layer + top_layers
    if low < 0 or high >= len(regions):
        return [NOTHING]
    return list({id(r): r for r in regions[low : high + 1]}.values())


def _bare(region: BaseGeometry, needed: list[BaseGeometry]) -> BaseGeometry:
    """Return what of `region` is not in all of `needed`."""
    common = region
    for other in needed:
        if other is not region:
            common = common.intersection(other)
    if common is region:
        return NOTHING
    return region if common.is_empty else region.difference(common)
