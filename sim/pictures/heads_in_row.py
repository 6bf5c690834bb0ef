"""Where heads stand in a row as near to each other as they may: for the picture of a machine.

With all tips at one height, on the bed's middle line along one axis. Nothing is drawn here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from decmcts.print.machine import Machine
from sim.arrays import Floats
from sim.replay.heads_near import Shapes, outermost, shapes_of
from sim.replay.shapes import Part, parts_of, separations_between

HALVINGS = 60  # of an interval of metres: far below what floats can tell

Point = Floats  # (2,)


@dataclass(frozen=True, slots=True)
class HeadsInRow:
    """Heads in a row, from the lowest coordinate up."""

    axis: int  # 0: along X, 1: along Y
    order: tuple[int, ...]  # heads of the machine
    nozzles: Floats  # (n, 2)
    gaps_mm: tuple[float, ...]  # between the bodies of neighbours
    ends: tuple[tuple[Point, Point], ...]  # of the gaps, seen from above
    by_rail: tuple[bool, ...]  # whether a rail keeps these neighbours further apart


def row_of(machine: Machine, axis: int) -> HeadsInRow | None:
    """Return the heads in a row along an axis; None where they cannot all stand so on the bed."""
    if len(machine.heads) < 2 or any(rail.axis != axis for rail in machine.rails):
        return None
    order = _order(machine, axis)
    parts = [outermost(parts_of(machine.heads[h])) for h in order]
    at, by_rail = [0.0], []
    for k in range(1, len(order)):
        need = max(at[j] + _least(machine, parts, j, k, axis) for j in range(k))
        railed = max(at[i] + _on_rail(machine, order[i], order[k]) for i in range(k))
        at.append(max(need, railed))
        by_rail.append(railed > need)
    low, high = (float(edge[axis]) for edge in (machine.bed_min, machine.bed_max))
    if at[-1] > high - low:
        return None
    nozzles = np.tile(np.add(machine.bed_min, machine.bed_max) / 2.0, (len(order), 1))
    nozzles[:, axis] += np.array(at) - at[-1] / 2.0
    pairs = [shapes_of(parts[k], parts[k + 1]) for k in range(len(order) - 1)]
    found = [gap_between(pair, nozzles[k], nozzles[k + 1]) for k, pair in enumerate(pairs)]
    gaps, ends = tuple(gap for gap, _ in found), tuple(end for _, end in found)
    return HeadsInRow(axis, tuple(order), nozzles, gaps, ends, tuple(by_rail))


def _order(machine: Machine, axis: int) -> list[int]:
    """Return the heads as the rail has them, others by where they park."""
    names = [head.name for head in machine.heads]
    order = sorted(range(len(names)), key=lambda h: machine.heads[h].park[axis])
    for rail in machine.rails:
        places = sorted(order.index(names.index(name)) for name in rail.order)
        for place, name in zip(places, rail.order, strict=True):
            order[place] = names.index(name)
    return order


def _on_rail(machine: Machine, h: int, g: int) -> float:
    """Return how far apart rails keep two nozzles; minus infinity where none does."""
    rails = separations_between(machine, machine.heads[h], machine.heads[g])
    return max((side * least for _, side, least in rails), default=-np.inf)


def _least(machine: Machine, parts: list[list[Part]], j: int, k: int, axis: int) -> float:
    """Return the least distance along the axis at which two heads keep their clearance."""
    shapes = shapes_of(parts[j], parts[k])
    unit = np.eye(2)[axis]
    return max((_end_of(shapes, pair, unit, machine.head_clearance_mm)
                for pair in range(len(shapes.parts))), default=0.0)  # fmt: skip


def _end_of(shapes: Shapes, pair: int, unit: Point, clearance_mm: float) -> float:
    """Return from where on along `unit` two parts keep a clearance, wherever they are before.

    The distance to a convex polygon is convex along a line, so they are too near on an interval.
    """
    level = np.sqrt(max(0.0, clearance_mm**2 - _above(shapes, pair) ** 2))
    hull = shapely.Polygon(_hull(shapes, pair))
    far = float(np.abs(_hull(shapes, pair)).max()) * 2.0 + clearance_mm + 1.0
    line = shapely.LineString([-far * unit, far * unit])
    if hull.distance(line) >= level:
        return 0.0
    nearest = np.array(shapely.shortest_line(line, hull).coords[0])
    inside, outside = float(-nearest @ unit), far
    for _ in range(HALVINGS):
        middle = (inside + outside) / 2.0
        if hull.distance(shapely.Point(-middle * unit)) < level:
            inside = middle
        else:
            outside = middle
    return max(0.0, outside)


def _hull(shapes: Shapes, pair: int) -> Floats:
    return shapes.xy[shapes.offsets[pair] : shapes.offsets[pair + 1]]


def _above(shapes: Shapes, pair: int) -> float:
    """Return how far one part is above the other, with both tips at one height."""
    low, high = shapes.boxes[pair, [2, 5]]
    return max(0.0, float(low), float(-high))


def gap_between(shapes: Shapes, at: Point, to: Point) -> tuple[float, tuple[Point, Point]]:
    """Return the least distance of two heads that stand still, and its ends from above."""
    best: tuple[float, tuple[Point, Point]] = (np.inf, (at, to))
    for pair, (a, b) in enumerate(shapes.parts):
        one, other = (shapely.Polygon(part.polygon + p) for part, p in ((a, at), (b, to)))
        line = shapely.shortest_line(one, other)
        gap = float(np.hypot(line.length, _above(shapes, pair)))
        if gap < best[0] - 1e-9:
            ends = np.array(line.coords)
            best = gap, (ends[0], ends[1])
    return best
