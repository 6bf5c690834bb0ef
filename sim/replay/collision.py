"""The one typed wrapper of FCL: convex bodies, swept along straight moves.

Only discrete `collide` and `distance` on conservatively swept shapes are used.
FCL's `continuousCollide` misses contacts with its default request (two 40 mm
boxes driven head-on returned "no contact"), so nothing here calls it; a
regression test drives that very case.
"""

from __future__ import annotations

from typing import Any

import fcl
import numpy as np
from scipy.spatial import ConvexHull

from sim.arrays import Floats, Ints

HEAD_TOP_MM = 500.0  # a head's slices fill space from their height up to here

Vertices = Floats  # (k, 3)


def prism_vertices(polygon: Floats, low: float, high: float) -> Vertices:
    """Return the corners of a convex polygon extruded from `low` to `high`."""
    flat = np.asarray(polygon, np.float64)
    rows = [np.column_stack([flat, np.full(len(flat), z)]) for z in (low, high)]
    return np.concatenate(rows)


def swept_vertices(shape: Vertices, start: Floats, end: Floats) -> Vertices:
    """Return points whose convex hull is the volume `shape` sweeps from start to end.

    Exact for a convex shape that translates along a straight line.
    """
    if np.array_equal(start, end):
        return shape + start
    return np.concatenate([shape + start, shape + end])


class Solid:
    """The convex hull of some points as an FCL body that stays where it is."""

    __slots__ = ("_body",)

    def __init__(self, vertices: Vertices) -> None:
        hull = ConvexHull(vertices)
        points = vertices[hull.vertices]
        number = np.full(len(vertices), -1)
        number[hull.vertices] = np.arange(len(hull.vertices))
        faces = _outward(points, number[hull.simplices])
        rows = np.column_stack([np.full(len(faces), 3), faces]).ravel()
        shape = fcl.Convex(np.ascontiguousarray(points), len(faces), rows)
        self._body: Any = fcl.CollisionObject(shape, fcl.Transform())

    def touches(self, other: Solid) -> bool:
        """Whether the two bodies overlap."""
        request, result = fcl.CollisionRequest(), fcl.CollisionResult()
        return bool(fcl.collide(self._body, other._body, request, result) > 0)

    def distance(self, other: Solid) -> float:
        """Return the gap between the two bodies in mm; 0 when they overlap."""
        if self.touches(other):
            return 0.0
        gap = fcl.distance(self._body, other._body, fcl.DistanceRequest(), fcl.DistanceResult())
        return max(0.0, float(gap))


def _outward(points: Vertices, faces: Ints) -> Ints:
    """Return the triangles with their corners counter-clockwise seen from outside."""
    a, b, c = (points[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    inward = np.einsum("ij,ij->i", normal, a - points.mean(axis=0)) < 0
    return np.where(inward[:, None], faces[:, [0, 2, 1]], faces)
