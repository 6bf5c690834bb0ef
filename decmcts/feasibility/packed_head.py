"""Heads and contours packed for the kernels, and the checks the kernels rely on.

The one place where `Head` becomes arrays; what the arrays mean stands at
`decmcts.feasibility.clearance_kernels`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from decmcts.arrays import Floats, Ints
from decmcts.feasibility.clearance_kernels import CHUNK, Centrelines, PackedHead
from decmcts.print.contours import Contours
from decmcts.print.machine import Head

CENTRELINE_MM = 0.003  # half width of a centreline: the rounding of a file, twice
LOW, HIGH = [0, 1, 4], [2, 3, 5]  # columns of a box, see `Centrelines`
TOUCH_EPS = 1e-9  # mm, exactly touching counts as blocked in spite of rounding


def pack_head(head: Head) -> PackedHead:
    """Return the slices of one head as flat polygons, ascending in height."""
    return pack_heads([head])


def pack_heads(heads: Sequence[Head]) -> PackedHead:
    """Return all slices of several heads at once: blocked means blocked for any of them.

    Polygons that lie inside one that starts at the same height or lower are left
    out; they can't block more.

    Raises
    ------
    ValueError
        If a polygon is not convex and counter-clockwise, or no head has a slice.
    """
    stack = [
        (float(part.height_mm), _convex(polygon))
        for head in heads
        for part in head.slices
        for polygon in part.polygons
    ]
    if not stack:
        raise ValueError("no head has a slice")
    stack.sort(key=lambda item: item[0])
    kept: list[tuple[float, Floats]] = []
    for height, polygon in stack:
        if not any(_contains(outer, polygon) for _, outer in kept):
            kept.append((height, polygon))
    return _pack(kept)


def pack_contours(
    contours: Contours, clearance_mm: float, *, bead_width: bool = True
) -> Centrelines:
    """Return contours with their boxes; radius is clearance + half the bead width.

    Without `bead_width` material is the centreline (the paper's model), plus a hair
    so that coordinates rounded in a file stay clear.
    """
    half = contours.width / 2 if bead_width else np.full(len(contours), CENTRELINE_MM)
    return boxed(contours.points, contours.offsets, clearance_mm + half + TOUCH_EPS)


def boxed(points: Floats, offsets: Ints, radius: Floats) -> Centrelines:
    """Return polylines points[offsets[i]:offsets[i + 1]] with their boxes."""
    offsets = np.ascontiguousarray(offsets, np.int64)
    points = np.ascontiguousarray(points, np.float64)
    chunks = -(-(np.diff(offsets) - 1) // CHUNK)
    chunk_offsets = np.concatenate([[0], np.cumsum(chunks)]).astype(np.int64)
    place = np.arange(chunk_offsets[-1]) - np.repeat(chunk_offsets[:-1], chunks)
    starts = np.repeat(offsets[:-1], chunks) + CHUNK * place
    ends = np.minimum(starts + CHUNK, np.repeat(offsets[1:] - 1, chunks))  # with the next begin
    chunk_boxes = np.empty((len(starts), 6))
    chunk_boxes[:, LOW] = np.minimum(np.minimum.reduceat(points, starts), points[ends])
    chunk_boxes[:, HIGH] = np.maximum(np.maximum.reduceat(points, starts), points[ends])
    boxes = boxes_of_runs(chunk_boxes, chunk_offsets[:-1])
    return Centrelines(points, offsets, radius, boxes, chunk_offsets, chunk_boxes)


def boxes_of_runs(boxes: Floats, starts: Ints) -> Floats:
    """Return the box around each run of boxes, (k, 6); run i begins at starts[i]."""
    around = np.empty((len(starts), 6))
    around[:, LOW] = np.minimum.reduceat(boxes[:, LOW], starts)
    around[:, HIGH] = np.maximum.reduceat(boxes[:, HIGH], starts)
    return around


def _edges(polygon: Floats) -> Floats:
    return np.asarray(np.roll(polygon, -1, axis=0) - polygon)


def _normals(polygon: Floats) -> Floats:
    edge = _edges(polygon)
    outward = np.stack([edge[:, 1], -edge[:, 0]], axis=1)
    return np.asarray(outward / np.linalg.norm(outward, axis=1, keepdims=True))


def _convex(polygon: Floats) -> Floats:
    vertices = np.ascontiguousarray(polygon, np.float64).reshape(-1, 2)
    vertices = np.ascontiguousarray(vertices[np.linalg.norm(_edges(vertices), axis=1) > 0.0])
    if len(vertices) < 3:
        raise ValueError("a slice polygon needs three different corners")
    values = vertices @ _normals(vertices).T  # (corner, edge)
    if (values - np.diag(values)[None, :]).max() > 1e-6:
        raise ValueError("a slice polygon must be convex and counter-clockwise")
    return vertices


def _contains(outer: Floats, polygon: Floats) -> bool:
    normals = _normals(outer)
    levels = (normals * outer).sum(axis=1)
    return bool(((polygon @ normals.T) <= levels[None, :]).all())


def _pack(stack: list[tuple[float, Floats]]) -> PackedHead:
    vertices = np.concatenate([polygon for _, polygon in stack])
    normals = np.concatenate([_normals(polygon) for _, polygon in stack])
    sizes = [len(polygon) for _, polygon in stack]
    return PackedHead(
        np.array([height for height, _ in stack]),
        np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        vertices,
        normals,
        (normals * vertices).sum(axis=1),
        np.array([[*polygon.min(axis=0), *polygon.max(axis=0)] for _, polygon in stack]),
    )
