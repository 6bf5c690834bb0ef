"""Does one contour's bead block the head at another contour: exact convex geometry.

The definition is "Blocked" in docs/definitions.md: for bead segment q, nozzle
segment p and slice k the set q_xy - p_xy is a parallelogram, and it is blocked
iff that parallelogram comes within clearance + w/2 of the slice's polygon and
the bead's highest z is above the nozzle's lowest z + h_k. Nothing here knows
about graphs or orders.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from decmcts.arrays import Floats, Ints
from decmcts.compiled import kernel

CHUNK = 16  # segments a chunk box covers: rejects most of a long contour at once
Z_EPS = 1e-6  # mm, material at the nozzle's own height does not block


class PackedHead(NamedTuple):
    """All slices of one or several heads as flat convex polygons, ascending height."""

    heights: Floats  # (m,) mm above the tip
    offsets: Ints  # (m + 1,) polygon k owns vertices[offsets[k]:offsets[k + 1]]
    vertices: Floats  # (v, 2) counter-clockwise, nozzle at the origin
    normals: Floats  # (v, 2) outward unit normal of the edge that starts here
    levels: Floats  # (v,) normal . vertex: the edge's support value
    boxes: Floats  # (m, 4) xmin, ymin, xmax, ymax


class Centrelines(NamedTuple):
    """Contours as the kernels see them. Boxes are xmin, ymin, xmax, ymax, zmin, zmax."""

    points: Floats  # (n_points, 3)
    offsets: Ints  # (n + 1,)
    radius: Floats  # (n,) clearance + half the width
    boxes: Floats  # (n, 6) of the centreline
    chunk_offsets: Ints  # (n + 1,)
    chunk_boxes: Floats  # (n_chunks, 6)


@kernel
def box_reaches(
    material: Floats,
    i: int,
    nozzle: Floats,
    j: int,
    head: PackedHead,
    k: int,
    r: float,
) -> bool:
    """Tell whether material box i may block polygon k of the head somewhere in nozzle box j."""
    return bool(
        material[i, 5] > nozzle[j, 4] + head.heights[k] + Z_EPS
        and material[i, 0] - nozzle[j, 2] <= head.boxes[k, 2] + r
        and material[i, 2] - nozzle[j, 0] >= head.boxes[k, 0] - r
        and material[i, 1] - nozzle[j, 3] <= head.boxes[k, 3] + r
        and material[i, 3] - nozzle[j, 1] >= head.boxes[k, 1] - r
    )


@kernel
def inside(x: float, y: float, head: PackedHead, k: int) -> bool:
    """Tell whether (x, y) lies in polygon k."""
    for e in range(head.offsets[k], head.offsets[k + 1]):
        if head.normals[e, 0] * x + head.normals[e, 1] * y > head.levels[e]:
            return False
    return True


@kernel
def point_segment2(px: float, py: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Return the squared distance of a point from a segment."""
    ux = bx - ax
    uy = by - ay
    length2 = ux * ux + uy * uy
    t = 0.0
    if length2 > 0.0:
        t = min(1.0, max(0.0, ((px - ax) * ux + (py - ay) * uy) / length2))
    dx = px - ax - t * ux
    dy = py - ay - t * uy
    return dx * dx + dy * dy


@kernel
def separated_by_slice(quad: Floats, head: PackedHead, k: int, r: float) -> bool:
    """Tell whether an edge of polygon k keeps all of the quad farther than r."""
    for e in range(head.offsets[k], head.offsets[k + 1]):
        least = np.inf
        for i in range(4):
            least = min(least, head.normals[e, 0] * quad[i, 0] + head.normals[e, 1] * quad[i, 1])
        if least > head.levels[e] + r:
            return True
    return False


@kernel
def separated_by_quad(quad: Floats, head: PackedHead, k: int) -> bool:
    """Tell whether an edge of the parallelogram separates it from polygon k."""
    for side in range(2):
        nx = -(quad[1 + 2 * side, 1] - quad[0, 1])
        ny = quad[1 + 2 * side, 0] - quad[0, 0]
        low = np.inf
        high = -np.inf
        for i in range(4):
            value = nx * quad[i, 0] + ny * quad[i, 1]
            low = min(low, value)
            high = max(high, value)
        slice_low = np.inf
        slice_high = -np.inf
        for v in range(head.offsets[k], head.offsets[k + 1]):
            value = nx * head.vertices[v, 0] + ny * head.vertices[v, 1]
            slice_low = min(slice_low, value)
            slice_high = max(slice_high, value)
        if low > slice_high or high < slice_low:
            return True
    return False


@kernel
def boundary_near(quad: Floats, head: PackedHead, k: int, r: float) -> bool:
    """Tell whether the outlines of quad and polygon k come within r of each other.

    For disjoint convex shapes the nearest pair contains a vertex of one of them.
    """
    first = head.offsets[k]
    count = head.offsets[k + 1] - first
    for i in range(4):
        ax, ay = quad[i, 0], quad[i, 1]
        bx, by = quad[(i + 1) % 4, 0], quad[(i + 1) % 4, 1]
        for v in range(count):
            vx, vy = head.vertices[first + v, 0], head.vertices[first + v, 1]
            after = first + (v + 1) % count
            wx, wy = head.vertices[after, 0], head.vertices[after, 1]
            if point_segment2(vx, vy, ax, ay, bx, by) <= r * r:
                return True
            if point_segment2(ax, ay, vx, vy, wx, wy) <= r * r:
                return True
    return False


@kernel
def quad_meets(quad: Floats, head: PackedHead, k: int, r: float) -> bool:
    """Tell whether the parallelogram comes within r of polygon k."""
    for i in range(4):
        if inside(quad[i, 0], quad[i, 1], head, k):
            return True
    if separated_by_slice(quad, head, k, r):
        return False
    if not separated_by_slice(quad, head, k, 0.0) and not separated_by_quad(quad, head, k):
        return True
    return boundary_near(quad, head, k, r)


@kernel
def segment_blocks(
    points: Floats,
    q: int,
    p: int,
    head: PackedHead,
    k: int,
    r: float,
    quad: Floats,
) -> bool:
    """Tell whether bead segment q..q+1 blocks slice polygon k on nozzle segment p..p+1.

    Overwrites `quad`, a (4, 2) scratch array.
    """
    if max(points[q, 2], points[q + 1, 2]) <= (
        min(points[p, 2], points[p + 1, 2]) + head.heights[k] + Z_EPS
    ):
        return False
    for axis in range(2):
        low = min(points[q, axis], points[q + 1, axis]) - max(points[p, axis], points[p + 1, axis])
        high = max(points[q, axis], points[q + 1, axis]) - min(points[p, axis], points[p + 1, axis])
        if low > head.boxes[k, axis + 2] + r or high < head.boxes[k, axis] - r:
            return False
    for axis in range(2):
        quad[0, axis] = points[q, axis] - points[p, axis]
        quad[1, axis] = points[q + 1, axis] - points[p, axis]
        quad[2, axis] = points[q + 1, axis] - points[p + 1, axis]
        quad[3, axis] = points[q, axis] - points[p + 1, axis]
    return quad_meets(quad, head, k, r)


@kernel
def chunk_depth(
    beads: Centrelines, a: int, chunk_a: int, b: int, chunk_b: int, head: PackedHead, k: int,
    depth: float, most: float, quad: Floats,
) -> float:  # fmt: skip
    """Return the greatest depth at which a chunk of a's bead blocks polygon k on a chunk of b.

    Only what is deeper than `depth` is looked at, which is returned where there is nothing; the
    first above `most` ends the search. The tests of `segment_blocks` by boxes stand here with bare
    numbers, operation by operation: a call that hands over all the arrays costs more than they do.
    """
    q_first = beads.offsets[a] + (chunk_a - beads.chunk_offsets[a]) * CHUNK
    p_first = beads.offsets[b] + (chunk_b - beads.chunk_offsets[b]) * CHUNK
    q_last = min(q_first + CHUNK, beads.offsets[a + 1] - 1)
    p_last = min(p_first + CHUNK, beads.offsets[b + 1] - 1)
    points, boxes, r = beads.points, beads.chunk_boxes, beads.radius[a]
    height, lowest = head.heights[k], boxes[chunk_b, 4]
    x_least, y_least = head.boxes[k, 0] - r, head.boxes[k, 1] - r
    x_most, y_most = head.boxes[k, 2] + r, head.boxes[k, 3] + r
    for q in range(q_first, q_last):
        x, y, z = points[q, 0], points[q, 1], points[q, 2]
        x_to, y_to, z_to = points[q + 1, 0], points[q + 1, 1], points[q + 1, 2]
        x_low, x_high = min(x, x_to), max(x, x_to)
        y_low, y_high, top = min(y, y_to), max(y, y_to), max(z, z_to)
        if (
            top <= lowest + height + Z_EPS
            or x_low - boxes[chunk_b, 2] > x_most
            or x_high - boxes[chunk_b, 0] < x_least
            or y_low - boxes[chunk_b, 3] > y_most
            or y_high - boxes[chunk_b, 1] < y_least
        ):
            continue
        for p in range(p_first, p_last):
            if (
                x_low - max(points[p, 0], points[p + 1, 0]) > x_most
                or x_high - min(points[p, 0], points[p + 1, 0]) < x_least
                or y_low - max(points[p, 1], points[p + 1, 1]) > y_most
                or y_high - min(points[p, 1], points[p + 1, 1]) < y_least
            ):
                continue
            over = top - min(points[p, 2], points[p + 1, 2])
            if over > depth and segment_blocks(points, q, p, head, k, r, quad):
                depth = over
                if depth > most:
                    return depth
    return depth


@kernel
def polygon_depth(
    beads: Centrelines, a: int, b: int, head: PackedHead, k: int, depth: float, most: float,
    quad: Floats,
) -> float:  # fmt: skip
    """Return as `chunk_depth`, of the whole contours a and b."""
    boxes, r = beads.chunk_boxes, beads.radius[a]
    for chunk_a in range(beads.chunk_offsets[a], beads.chunk_offsets[a + 1]):
        if not box_reaches(boxes, chunk_a, beads.boxes, b, head, k, r):
            continue
        for chunk_b in range(beads.chunk_offsets[b], beads.chunk_offsets[b + 1]):
            if boxes[chunk_a, 5] - boxes[chunk_b, 4] > depth and box_reaches(
                boxes, chunk_a, boxes, chunk_b, head, k, r
            ):
                depth = chunk_depth(beads, a, chunk_a, b, chunk_b, head, k, depth, most, quad)
                if depth > most:
                    return depth
    return depth


@kernel
def contact_depth(
    beads: Centrelines, a: int, b: int, head: PackedHead, most: float, quad: Floats
) -> tuple[float, int]:
    """Return how far a's bead stands above the tip where it blocks the head at b, and the polygon.

    The greatest over all segments, mm, 0 and -1 where it does not block; the first above `most`
    ends the search.
    """
    depth, polygon = 0.0, -1
    for k in range(len(head.heights)):
        if beads.boxes[a, 5] <= beads.boxes[b, 4] + head.heights[k] + Z_EPS:
            break  # all others are higher
        if not box_reaches(beads.boxes, a, beads.boxes, b, head, k, beads.radius[a]):
            continue
        found = polygon_depth(beads, a, b, head, k, depth, most, quad)
        if found > depth:
            depth, polygon = found, k
            if depth > most:
                break
    return depth, polygon
