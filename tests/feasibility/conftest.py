"""Small random prints and the slow, obvious definition of "blocked"."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from decmcts.print.contours import Contours
from decmcts.print.machine import Head, Slice

Polylines = list[list[tuple[float, float, float]]]


def make_contours(
    polylines: Polylines,
    *,
    width: list[float] | float = 0.4,
    layer: list[int] | None = None,
    role: list[int] | None = None,
    epoch: list[int] | None = None,
    line: list[int] | None = None,
) -> Contours:
    n = len(polylines)
    points = np.array([p for polyline in polylines for p in polyline], np.float64).reshape(-1, 3)
    zeros = np.zeros(n, np.int32)
    return Contours(
        points=points,
        offsets=np.cumsum([0] + [len(polyline) for polyline in polylines]).astype(np.int64),
        extrusion=np.zeros(len(points)),
        feed=np.zeros(len(points)),
        width=np.broadcast_to(np.asarray(width, np.float64), (n,)).copy(),
        height=np.full(n, 0.2),
        role=zeros.astype(np.int8) if role is None else np.array(role, np.int8),
        closed=np.zeros(n, np.bool_),
        layer=zeros if layer is None else np.array(layer, np.int32),
        tool=zeros.astype(np.int16),
        reversible=np.ones(n, np.bool_),
        epoch=zeros.copy() if epoch is None else np.array(epoch, np.int32),
        line=zeros.copy() if line is None else np.array(line, np.int32),
    )


def box(x0: float, y0: float, x1: float, y1: float) -> NDArray[np.float64]:
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], np.float64)


def head_of(*slices: tuple[float, list[NDArray[np.float64]]]) -> Head:
    return Head("test", tuple(Slice(height, tuple(polygons)) for height, polygons in slices))


def random_print(
    seed: int, *, n_layers: int = 6, per_layer: int = 5, span: float = 40.0, slope: float = 0.0
) -> Contours:
    """Layers of short random polylines with random widths, roles and one epoch change."""
    rng = np.random.default_rng(seed)
    polylines: Polylines = []
    layers, roles, epochs, widths = [], [], [], []
    for layer in range(n_layers):
        for _ in range(int(rng.integers(1, per_layer + 1))):
            steps = rng.normal(0.0, 3.0, (int(rng.integers(2, 24)), 2))
            steps[rng.random(len(steps)) < 0.1] = 0.0
            xy = rng.uniform(0.0, span, 2) + np.cumsum(steps, axis=0)
            z = 0.5 * (layer + 1) - slope * rng.random(len(xy))
            polylines.append(
                [(float(x), float(y), float(h)) for (x, y), h in zip(xy, z, strict=True)]
            )
            layers.append(layer)
            roles.append(int(rng.integers(1, 4)))
            epochs.append(int(seed % 3 == 0 and layer >= 1))
            widths.append(float(rng.uniform(0.2, 0.8)))
    return make_contours(polylines, width=widths, layer=layers, role=roles, epoch=epochs)


PENTAGON = np.array([[2.0, -3.0], [9.0, -1.0], [8.0, 4.0], [3.0, 6.0], [-1.0, 1.0]])
HEADS = {
    "box": head_of((0.0, [box(-7, -7, 7, 7)])),
    "lopsided": head_of((0.0, [PENTAGON]), (1.2, [box(-3, -20, 1, 2), box(5, 5, 30, 9)])),
    "hollow": head_of((0.3, [box(4, -2, 8, 2)]), (1.0, [box(-200, -9, 200, -6)])),
}


def swept(polygon: NDArray[np.float64], segment: NDArray[np.float64]) -> shapely.Geometry:
    """Return the XY region a slice polygon fills while the nozzle runs along a segment."""
    corners = (polygon[None, :, :] + segment[:, None, :2]).reshape(-1, 2)
    return shapely.MultiPoint(corners).convex_hull


def segments(contours: Contours, i: int) -> list[NDArray[np.float64]]:
    polyline = contours.polyline(i)
    return [polyline[k : k + 2] for k in range(len(polyline) - 1)]


def hits(move: NDArray[np.float64], bead: NDArray[np.float64], head: Head, radius: float) -> bool:
    """Say whether a widened bead segment blocks the head on a straight nozzle move."""
    line = shapely.LineString(bead[:, :2])
    for part in head.slices:
        if bead[:, 2].max() <= move[:, 2].min() + part.height_mm + 1e-6:
            continue
        for polygon in part.polygons:
            if swept(polygon, move).distance(line) <= radius:
                return True
    return False


def blocks(contours: Contours, b: int, a: int, head: Head, clearance_mm: float) -> bool:
    """Say by the definition whether contour b's bead blocks the head somewhere on a."""
    radius = clearance_mm + contours.width[b] / 2
    return any(
        hits(p, q, head, radius) for p in segments(contours, a) for q in segments(contours, b)
    )


def touch(contours: Contours, a: int, b: int) -> bool:
    lines = [shapely.LineString(contours.polyline(i)[:, :2]) for i in (a, b)]
    gap = (contours.width[a] + contours.width[b]) / 2 + 0.05
    return bool(lines[0].distance(lines[1]) <= gap)


def anchors(first: int, second: int) -> bool:
    """Say whether quality keeps these roles in order: shells, and infill after shells."""
    return first in (1, 2, 3) and second in (1, 2, 3, 4, 5, 6, 7, 8)


def blocked(contours: Contours, heads: list[Head], clearance_mm: float) -> NDArray[np.bool_]:
    """Return the (n, n) matrix [b, a]: b's bead blocks a head on a; the source prints a first."""
    found = np.zeros((len(contours), len(contours)), np.bool_)
    for b in range(len(contours)):
        for a in range(b):
            found[b, a] = any(blocks(contours, b, a, head, clearance_mm) for head in heads)
    return found


def must_precede(contours: Contours, a: int, b: int, *, keep: bool, quality: bool) -> bool:
    """Say whether a comes first for reasons other than space."""
    if contours.epoch[a] < contours.epoch[b]:
        return True
    same_layer = contours.layer[a] == contours.layer[b]
    roles = int(contours.role[a]), int(contours.role[b])
    held = (keep and roles[0] != roles[1]) or (quality and anchors(*roles))
    return held and same_layer and touch(contours, a, b)


def slow_closure(
    contours: Contours, blocked: NDArray[np.bool_], *, keep: bool, quality: bool = False
) -> NDArray[np.bool_]:
    """Return the (n, n) matrix [b, a]: a must be printed before b, transitively."""
    n = len(contours)
    closure = np.zeros((n, n), np.bool_)
    for b in range(n):
        for a in range(b):
            if blocked[b, a] or must_precede(contours, a, b, keep=keep, quality=quality):
                closure[b, a] = True
                closure[b] |= closure[a]
    return closure


@dataclass(frozen=True)
class Oracle:
    """What the tests need, as one fixture."""

    make_contours: Callable[..., Contours]
    random_print: Callable[..., Contours]
    head_of: Callable[..., Head]
    box: Callable[..., NDArray[np.float64]]
    blocked: Callable[..., NDArray[np.bool_]]
    slow_closure: Callable[..., NDArray[np.bool_]]
    hits: Callable[..., bool]
    blocks: Callable[..., bool]
    segments: Callable[..., list[NDArray[np.float64]]]
    heads: dict[str, Head]


@pytest.fixture(scope="session")
def oracle() -> Oracle:
    return Oracle(
        make_contours,
        random_print,
        head_of,
        box,
        blocked,
        slow_closure,
        hits,
        blocks,
        segments,
        HEADS,
    )
