"""A solid plate with round holes, made as arrays: what heads share, in any size."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import chain

import numpy as np
import shapely
from numpy.typing import NDArray

from decmcts.planning.arrays import from_arrays
from decmcts.planning.problem.source import Source
from decmcts.print.contours import Role
from decmcts.print.machine import Machine

HEIGHT, WIDTH = 0.2, 0.45  # mm, of a bead
PITCH = WIDTH - HEIGHT * (1.0 - np.pi / 4.0)  # mm, of beads side by side
SOLID_LAYERS, DENSITY = 3, 0.2
FEED = {
    Role.PERIMETER: 60.0, Role.EXTERNAL_PERIMETER: 40.0, Role.INFILL: 80.0,
    Role.SOLID_INFILL: 60.0, Role.TOP_SOLID_INFILL: 60.0,
}  # fmt: skip
Bead = tuple[Role, NDArray[np.float64]]  # what for, (k, 2) mm


def plate(
    size: tuple[float, float, float], middle: tuple[float, float], machine: str | Machine, *,
    holes: Sequence[tuple[float, float]] = (), radius: float = 0.0,
) -> Source:  # fmt: skip
    """Return a plate of a size on a machine, with holes at some places, mm."""
    (wide, deep, high), (x, y) = size, middle
    shape = shapely.box(x - wide / 2, y - deep / 2, x + wide / 2, y + deep / 2)
    shape = shape.difference(shapely.MultiPoint(list(holes)).buffer(radius))
    count = round(high / HEIGHT)
    beads = [(layer, *bead) for layer in range(count) for bead in _layer(shape, layer, count)]
    points = [
        np.column_stack([path, np.full(len(path), HEIGHT * (layer + 1))])
        for layer, _, path in beads
    ]
    return from_arrays(
        np.concatenate(points),
        np.cumsum([0, *map(len, points)]),
        np.array([layer for layer, _, _ in beads]),
        machine,
        role=np.array([role for _, role, _ in beads]),
        feed=np.array([FEED[role] if layer else 30.0 for layer, role, _ in beads]),
    )


def _layer(shape: shapely.Geometry, layer: int, count: int) -> Iterator[Bead]:
    """Yield two walls round everything, the inner one first, and what fills them."""
    for role, inset in (
        (Role.PERIMETER, WIDTH / 2 + PITCH), (Role.EXTERNAL_PERIMETER, WIDTH / 2),
    ):  # fmt: skip
        for part in shapely.get_parts(shape.buffer(-inset, join_style="mitre")):
            for ring in (part.exterior, *part.interiors):
                yield role, shapely.get_coordinates(ring)
    solid = min(layer, count - 1 - layer) < SOLID_LAYERS
    role = Role.SOLID_INFILL if solid else Role.INFILL
    if layer == count - 1:
        role = Role.TOP_SOLID_INFILL
    inside = shape.buffer(-WIDTH / 2 - 2 * PITCH, join_style="mitre")
    angle = np.pi / 4 if layer % 2 else -np.pi / 4
    for path in zigzags(inside, PITCH if solid else PITCH / DENSITY, angle):
        yield role, path


@lru_cache(maxsize=4)  # every other layer is alike
def zigzags(inside: shapely.Geometry, apart: float, angle: float) -> list[NDArray[np.float64]]:
    """Return (k, 2) paths of parallel lines, joined where the next one begins near by."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    inside = shapely.transform(inside, lambda xy: xy @ turn)
    around = inside.buffer(WIDTH / 4)  # chords of round holes lie a little outside
    shapely.prepare(around)
    left, low, right, high = inside.bounds
    paths: list[list[NDArray[np.float64]]] = []
    before: list[int] = []  # paths that end on the row before
    for row in np.arange(np.ceil(low / apart), np.floor(high / apart) + 1) * apart:
        cut = shapely.LineString([(left - 1, row), (right + 1, row)]).intersection(inside)
        lines = [shapely.get_coordinates(part) for part in shapely.get_parts(cut)]
        going = []
        for line in (line for line in lines if len(line) == 2):
            on = next((k for k in before if _near(paths[k][-1][-1], line, apart, around)), None)
            if on is None:
                paths.append([line])
                going.append(len(paths) - 1)
                continue
            before.remove(on)
            gaps = np.linalg.norm(line - paths[on][-1][-1], axis=1)
            paths[on].append(line if gaps[0] < gaps[1] else line[::-1])
            going.append(on)
        before = going
    return [np.array(list(chain.from_iterable(path))) @ turn.T for path in paths]


def _near(
    end: NDArray[np.float64], line: NDArray[np.float64], apart: float, around: shapely.Geometry
) -> bool:
    """Tell whether a path that ends there may go on with a line."""
    gaps = np.linalg.norm(line - end, axis=1)
    if gaps.min() >= 3 * apart:
        return False
    return bool(around.covers(shapely.LineString([end, line[int(gaps.argmin())]])))
