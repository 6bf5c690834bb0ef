"""Machines of two to eight heads and prints for them, made at random.

Rails along x or y, two rails at once, heads in a row without one or around the bed;
heads with shapes that are not symmetric, with beams, limits, reaches and tools of
their own. The prints are small towers all over the bed. No planning here.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob, ProcessSettings
from decmcts.print.machine import Body, Head, Machine, MotionLimits, Rail, Slice

BED_MM = 90.0  # a head's share of the bed along the heads' axis
DEPTH_MM = 80.0  # of a bed with heads in a row
SQUARE_MM = 140.0  # of a bed with heads around it
EDGE_MM = 12.0  # of the bed that stays free of prints
KINDS = ("rail", "row", "around", "rail along y", "two rails")

Floats = NDArray[np.float64]


def random_machine(seed: int) -> Machine:
    """Return a machine of two to eight heads; the same for the same seed."""
    rng = np.random.default_rng([seed, 1])
    n, kind = int(rng.integers(2, 9)), KINDS[int(rng.integers(len(KINDS)))]
    shapes = [_shape(rng) for _ in range(n)]
    gap = float(rng.uniform(0.5, 3.0))
    pitch = 2.0 * max(float(np.abs(corners).max()) for corners, _, _ in shapes) + gap
    pitch += float(rng.uniform(0.0, 8.0))
    axis = int(kind == "rail along y")
    size = np.full(2, SQUARE_MM)
    if kind != "around":
        size[axis], size[1 - axis] = BED_MM * n, DEPTH_MM
    heads = [
        _head(r, shape, _park(r, n, kind, size, pitch, rng), size, rng)
        for r, shape in enumerate(shapes)
    ]
    return Machine(
        f"random {seed} ({kind})", (0.0, 0.0), (float(size[0]), float(size[1])), tuple(heads),
        head_clearance_mm=gap,
        rails=tuple(_rails(kind, [head.name for head in heads], pitch)),
        release="point" if rng.random() < 0.7 else "action",
        lift_mm=float(rng.uniform(0.1, 1.0)),
    )  # fmt: skip


def _shape(rng: np.random.Generator) -> tuple[Floats, tuple[Slice, ...], Body]:
    """Return the corners of a head's carriage around its nozzle, its slices and its carriage."""
    low, high = -rng.uniform(4.0, 9.0, 2), rng.uniform(4.0, 9.0, 2)
    corners = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    tip = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * rng.uniform(1.0, 2.5)
    slices = Slice(0.0, (tip,)), Slice(float(rng.uniform(1.0, 4.0)), (corners,))
    (x0, y0), (x1, y1) = low.tolist(), high.tolist()
    return corners, slices, Body("carriage", (x0, y0, 6.0), (x1, y1, 30.0))


def _head(
    r: int,
    shape: tuple[Floats, tuple[Slice, ...], Body],
    park: tuple[float, float, float],
    size: Floats,
    rng: np.random.Generator,
) -> Head:
    """Return a head: three in ten reach only a part, one in ten has a tool nobody asks for."""
    low, high = np.zeros(2), size.copy()
    if rng.random() < 0.3:
        axis = int(rng.integers(2))
        low[axis], high[axis] = np.sort(rng.uniform(0.0, size[axis], 2))
    limits = MotionLimits(travel_feed=float(rng.uniform(60.0, 300.0)))
    return Head(
        f"head {r}",
        shape[1],
        bodies=(shape[2],),
        park=park,
        reach_min=(float(low[0]), float(low[1]), 0.0),
        reach_max=(float(high[0]), float(high[1]), 60.0),
        tools=(1,) if r and rng.random() < 0.1 else (),
        limits=limits if rng.random() < 0.3 else None,
    )


def _rails(kind: str, names: list[str], pitch: float) -> list[Rail]:
    """Return the rails; of two rails the heads take turns."""
    if kind in ("rail", "rail along y"):
        return [Rail(int(kind != "rail"), tuple(names), pitch)]
    if kind != "two rails":
        return []
    return [Rail(0, tuple(names[k::2]), pitch) for k in range(2) if len(names[k::2]) > 1]


def _park(
    r: int, n: int, kind: str, size: Floats, pitch: float, rng: np.random.Generator
) -> tuple[float, float, float]:
    """Return where a head parks: beside the bed in a row's order, or anywhere around it."""
    z = float(rng.uniform(2.0, 12.0))
    if kind == "around":
        side, place = r % 4, (r // 4 + 0.5) / 2.0
        off = pitch + 2.0
        x, y = [
            (-off, place * size[1]), (size[0] + off, place * size[1]),
            (place * size[0], -off), (place * size[0], size[1] + off),
        ][side]  # fmt: skip
        return float(x), float(y), z
    axis = int(kind == "rail along y")
    place, count = (r // 2, (n - r % 2 + 1) // 2) if kind == "two rails" else (r, n)
    left = count // 2
    along = -pitch * (left - place)
    if place >= left:
        along = float(size[axis]) + pitch * (place - left + 1)
    across = float(rng.uniform(0.0, size[1 - axis]))
    if kind == "two rails":
        across = -pitch / 2.0 if r % 2 else DEPTH_MM + pitch / 2.0
    return (along, across, z) if axis == 0 else (across, along, z)


def random_print(machine: Machine, seed: int, towers: int = 8, layers: int = 3) -> PrintJob:
    """Return towers over the bed of a machine: a loop and a stroke on each layer, some wide.

    One stroke in six may not be reversed.
    """
    rng = np.random.default_rng([seed, 2])
    low, high = np.array(machine.bed_min) + EDGE_MM, np.array(machine.bed_max) - EDGE_MM
    centres, sizes = rng.uniform(low, high, (towers, 2)), rng.uniform(1.5, 11.0, (towers, 2))
    lines, layer = [], []
    for level in range(layers):
        for centre, size in zip(centres, sizes, strict=True):
            corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * size + centre
            strokes = np.array([[-0.6, -0.6], [0.0, 0.5], [0.6, -0.6], [0.7, 0.7]]) * size + centre
            for shape in (corners, strokes):
                lines.append(np.column_stack([shape, np.full(len(shape), 0.4 * (level + 1))]))
                layer.append(level)
    contours = contours_of(lines, layer)
    contours = replace(contours, reversible=contours.closed | (rng.random(len(lines)) > 1 / 6))
    return PrintJob(f"towers {seed}", contours, ProcessSettings(travel_feed=120.0))


def contours_of(lines: list[Floats], layer: list[int], height: float = 0.4) -> Contours:
    """Return contours of these polylines, mm, each (k, 3); all else is plain."""
    n, offsets = len(lines), np.cumsum([0, *(len(line) for line in lines)]).astype(np.int64)
    points = np.concatenate(lines) if n else np.empty((0, 3))
    feed = np.full(len(points), 40.0)
    feed[offsets[:-1]] = 0.0
    return Contours(
        points=points,
        offsets=offsets,
        extrusion=np.where(feed > 0, 0.1, 0.0),
        feed=feed,
        width=np.full(n, 0.5),
        height=np.full(n, height),
        role=np.ones(n, np.int8),
        closed=np.array([len(p) > 2 and bool((p[0] == p[-1]).all()) for p in lines], np.bool_),
        layer=np.array(layer, np.int32),
        tool=np.zeros(n, np.int16),
        reversible=np.ones(n, np.bool_),
        epoch=np.zeros(n, np.int32),
        line=np.zeros(n, np.int32),
    )
