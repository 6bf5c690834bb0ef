"""What meets: the convex parts of a head, and the beads of a print.

This is the one typed wrapper of FCL. Only discrete `collide` and `distance` on conservatively swept
shapes are used. FCL's `continuousCollide` misses contacts with its default request (two 40 mm boxes
driven head-on returned "no contact"), so nothing here calls it; a regression test drives that very
case.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import fcl
import numpy as np
from scipy.spatial import ConvexHull

from decmcts.arrays import Flags, Floats, Ints
from decmcts.print.contours import Contours
from decmcts.print.machine import Head, Machine


@dataclass(frozen=True, slots=True)
class Beads:
    """Printed segments in any order, each with the first move that may meet it."""

    start: Floats  # (n, 3)
    end: Floats  # (n, 3)
    width: Floats  # (n,)
    height: Floats  # (n,)
    since: Ints  # (n,) index of the first move at which it may be there
    label: Ints  # (n,) what the caller calls it, e.g. the contour

    def at(self, rows: Flags) -> Beads:
        """Return some of the beads."""
        return Beads(*(getattr(self, name)[rows] for name in self.__slots__))


def beads_there(printed: Contours) -> Beads:
    """Return the beads of contours that stand there before the first move."""
    begins = np.zeros(len(printed.points), np.bool_)
    begins[printed.offsets[:-1]] = True
    end = np.flatnonzero(~begins)
    label = np.repeat(np.arange(len(printed)), np.diff(printed.offsets) - 1)
    return Beads(
        printed.points[end - 1], printed.points[end], printed.width[label], printed.height[label],
        np.zeros(len(end), np.int64), label.astype(np.int64),
    )  # fmt: skip


CENTRELINE_MM = 1e-3
"""Width that stands for a centreline, once the tolerance is taken off both sides."""


def as_material(beads: Beads, machine: Machine, tolerance_mm: float) -> Beads:
    """Return the beads as the machine's model counts them: with their width, or as lines."""
    if machine.bead_width:
        return beads
    return replace(beads, width=np.full_like(beads.width, CENTRELINE_MM + 2 * tolerance_mm))


@dataclass(frozen=True, slots=True)
class Part:
    """A convex prism of the head, relative to the tip."""

    name: str
    polygon: Floats  # (k, 2) counter-clockwise
    low: float
    high: float
    slice: bool = False  # a slice of the head: it has no top, and keeps the clearance

    def vertices(self) -> Vertices:
        """Return its corners."""
        n = len(self.polygon)
        ends = [np.column_stack([self.polygon, np.full(n, z)]) for z in (self.low, self.high)]
        return np.concatenate(ends)


def parts_of(head: Head) -> list[Part]:
    """Return the convex parts of a head: every slice polygon and every body."""
    parts = []
    for piece in head.slices:
        for polygon in piece.polygons:
            name, corners = f"slice at {piece.height_mm:g} mm", np.array(polygon, np.float64)
            parts.append(Part(name, corners, piece.height_mm, HEAD_TOP_MM, slice=True))
    for body in head.bodies:
        (x, y, _), (to_x, to_y, _) = body.minimum, body.maximum
        corners = np.array([[x, y], [to_x, y], [to_x, to_y], [x, to_y]], np.float64)
        parts.append(Part(body.name, corners, body.minimum[2], body.maximum[2]))
    return parts


def separations_between(machine: Machine, a: Head, b: Head) -> list[tuple[int, float, float]]:
    """Return axis, side of b as a sign, and least separation (mm) of each rail that has both."""
    found = []
    for rail in machine.rails:
        if {a.name, b.name} <= set(rail.order):
            steps = rail.order.index(b.name) - rail.order.index(a.name)
            found.append((rail.axis, 1.0 if steps > 0 else -1.0, abs(steps) * rail.separation_mm))
    return found


HEAD_TOP_MM = 500.0  # a head's slices fill space from their height up to here

Vertices = Floats  # (k, 3)


def bounds_of(shape: Vertices) -> Floats:
    """Return least and most x, y and z of a shape, (2, 3)."""
    return np.stack([shape.min(axis=0), shape.max(axis=0)])


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
        faces = number[hull.simplices]
        a, b, c = (points[faces[:, i]] for i in range(3))
        inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a - points.mean(axis=0)) < 0
        faces[inward] = faces[inward][:, [0, 2, 1]]  # counter-clockwise seen from outside
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
