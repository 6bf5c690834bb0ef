"""Cross sections of a closed mesh, one region a layer, and which parts of each are solid."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np
import shapely
import trimesh
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

_RESOLUTION_MM = 0.0125  # PrusaSlicer's: finer than any printer follows
_SLIVER_MM = 0.02  # thinner parts of a section are numerical noise
NOTHING = shapely.MultiPolygon()


@dataclass(frozen=True, slots=True)
class Layers:
    """The layers of a solid; neighbours that are alike share one region object."""

    z: NDArray[np.float64]  # (n,) top of each layer, the nozzle's height, mm
    height: NDArray[np.float64]  # (n,) mm
    regions: tuple[BaseGeometry, ...]  # (n,) polygonal, mm


def cut_layers(mesh: trimesh.Trimesh, first_height: float, height: float) -> Layers:
    """Cut a closed mesh that stands on z 0 at the middle of each layer.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        Closed, lowest point at z 0, mm.
    first_height, height : float
        Heights of the first and of the other layers, mm.
    """
    top = float(mesh.bounds[1][2])
    others = max(0, int(np.ceil((top - first_height) / height - 0.5 - 1e-6)))
    heights = np.array([first_height] + [height] * others)
    z = np.cumsum(heights).round(6)
    regions = [_clean(r) for r in _sections(mesh, z - heights / 2.0)]
    return Layers(z, heights, tuple(_shared(regions)))


def _sections(mesh: trimesh.Trimesh, at: NDArray[np.float64]) -> list[BaseGeometry]:
    """Cut with manifold3d; where it finds no manifold (edges of four faces), with trimesh."""
    solid = manifold3d.Manifold(
        manifold3d.Mesh(
            np.ascontiguousarray(mesh.vertices, np.float32),
            np.ascontiguousarray(mesh.faces, np.uint32),
        )
    )
    if solid.status() == manifold3d.Error.NoError and not solid.is_empty():
        return [_of_cross_section(solid.slice(float(z))) for z in at]
    return [_of_path(path) for path in mesh.section_multiplane([0, 0, 0], [0, 0, 1], at)]


def _of_cross_section(section: manifold3d.CrossSection) -> BaseGeometry:
    """Return the area of a manifold3d section; outer rings run counter-clockwise."""
    parts = []
    for island in section.decompose():
        rings = [np.asarray(ring) for ring in island.to_polygons()]
        if not rings:  # a cut above the solid
            continue
        outer = max(rings, key=_area)
        parts.append(shapely.Polygon(outer, [ring for ring in rings if ring is not outer]))
    return shapely.MultiPolygon(parts)


def _area(ring: NDArray[np.float64]) -> float:
    ahead = np.roll(ring, -1, axis=0)
    return float((ring[:, 0] * ahead[:, 1] - ring[:, 1] * ahead[:, 0]).sum())


def _of_path(path: trimesh.path.Path2D | None) -> BaseGeometry:
    if path is None:
        return shapely.MultiPolygon()
    placed = [
        shapely.affinity.translate(p, *path.metadata["to_3D"][:2, 3]) for p in path.polygons_full
    ]
    return shapely.union_all(placed)


def _clean(region: BaseGeometry) -> BaseGeometry:
    valid = region if region.is_valid else region.buffer(0)
    opened = valid.buffer(-_SLIVER_MM, join_style="mitre").buffer(_SLIVER_MM, join_style="mitre")
    return opened.simplify(_RESOLUTION_MM)


def _shared(regions: list[BaseGeometry]) -> list[BaseGeometry]:
    """Let equal neighbours be one object, so that prismatic parts are computed once."""
    shared = regions[:1]
    for region in regions[1:]:
        same = region.equals_exact(shared[-1], 1e-4)
        shared.append(shared[-1] if same else region)
    return shared


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
