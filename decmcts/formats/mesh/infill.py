"""Rectilinear infill: parallel lines through a region, joined along its border.

With lines one bead apart the joints, which cover half of the border, fill just
what the lines' ends leave open there.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from decmcts.formats.mesh.infill_joints import Joint, border_joints

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


def _chains(ends: NDArray[np.float64], joints: dict[int, Joint]) -> list[NDArray[np.float64]]:
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
