"""What a polygon of a head's slice must be: convex, counter-clockwise, simple.

The tests for clearance rely on it (Minkowski sums of convex polygons), so a
file that breaks it is refused rather than repaired: a hull would make the head
larger than the user meant, a reversed ring may hide swapped axes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

from decmcts.formats.files.fields import fail


def check_polygon(polygon: NDArray[np.float64], where: str, path: Path | str | None = None) -> None:
    """Raise InputError unless (k, 2) `polygon` is convex, counter-clockwise and simple."""
    if len(polygon) < 3:
        fail(where, f"{len(polygon)} points are no polygon, 3 are needed", path)
    repeated = np.flatnonzero((polygon == np.roll(polygon, -1, axis=0)).all(axis=1))
    if len(repeated):
        k, n = int(repeated[0]), len(polygon)
        fail(where, f"point {(k + 1) % n + 1} repeats point {k + 1}", path, "name each corner once")
    if not shapely.LinearRing(polygon).is_simple:
        fail(where, "it crosses or touches itself", path)
    turns = _turns(polygon)
    if _area(polygon) == 0.0:
        fail(where, "it has no area", path)
    if (turns <= 0.0).all():
        fail(where, "it runs clockwise (inside out)", path, "list its corners counter-clockwise")
    if (turns < 0.0).any():
        corner = int(np.flatnonzero(turns * np.sign(_area(polygon)) < 0.0)[0])
        x, y = polygon[corner]
        advice = "split it into convex polygons"
        fail(where, f"it is concave at corner {corner + 1} ({x:g}, {y:g})", path, advice)


def covers_nozzle(polygon: NDArray[np.float64]) -> bool:
    """Tell whether the origin lies in a convex counter-clockwise polygon, edges included."""
    return bool((_crossed(polygon) >= 0.0).all())


def inner_radius(polygon: NDArray[np.float64]) -> float:
    """Return the distance of the origin to the nearest side, below 0 outside."""
    sides = np.roll(polygon, -1, axis=0) - polygon
    return float((_crossed(polygon) / np.linalg.norm(sides, axis=1)).min())


def _turns(polygon: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (k,) cross products at the corners: positive turns left."""
    into = polygon - np.roll(polygon, 1, axis=0)
    out = np.roll(polygon, -1, axis=0) - polygon
    return np.asarray(into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0])


def _area(polygon: NDArray[np.float64]) -> float:
    return float(_crossed(polygon).sum() / 2.0)


def _crossed(polygon: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (k,) cross products of each corner and the next."""
    ahead = np.roll(polygon, -1, axis=0)
    return np.asarray(polygon[:, 0] * ahead[:, 1] - polygon[:, 1] * ahead[:, 0])
