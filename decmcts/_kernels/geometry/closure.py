"""Which contour must precede which: the walk that finds the edges, and closures as bit rows.

Contours are taken in source order. For each contour b its candidates a < b are
walked downwards; one that is already an ancestor of b is skipped 64 at a time,
one that is required becomes an edge and hands its own ancestors to b. So the
closure is exact and the stored edges are transitively reduced.

Memory stays bounded by walking the ancestors in column blocks, highest first:
a block needs only its own bits of each row, and the edges found before it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.geometry.clearance import (
    CHUNK,
    Z_EPS,
    Beads,
    PackedHead,
    blocking_polygon,
    box_points,
    point_segment2,
)
from decmcts._kernels.jit import kernel

WORD = 64
GEOMETRY, STATE = 1, 3  # decmcts.feasibility.graph.EdgeKind
TOUCH_MM = 0.05  # beads nearer than this touch
NO_EDGE = -1
ALL = np.uint64(2**64 - 1)


class ClosureRules(NamedTuple):
    """What besides geometry orders contours."""

    layer: NDArray[np.int32]  # (n,)
    role: NDArray[np.int8]  # (n,)
    epoch: NDArray[np.int32]  # (n,) non-decreasing
    width: NDArray[np.float64]  # (n,) mm
    touching: NDArray[np.uint8]  # (roles, roles) kind of edge between touching contours, 0: none
    keep: bool  # whether any entry of `touching` is not 0


class Words(NamedTuple):
    """Bounds of each run of 64 contours, to skip the run as a whole."""

    boxes: NDArray[np.float64]  # (n_words, 6)
    layers: NDArray[np.int32]  # (n_words, 2) lowest, highest


class Edges(NamedTuple):
    """A growing list of edges, linked by their later end."""

    latest: NDArray[np.int64]  # (n,) newest edge into b, NO_EDGE if none
    older: NDArray[np.int64]  # (capacity,) next older edge into the same b
    source: NDArray[np.int32]  # (capacity,) a
    kind: NDArray[np.uint8]  # (capacity,)
    used: NDArray[np.int64]  # (1,) how many of the capacity


class Scratch(NamedTuple):
    """Memory of the walk that each contour overwrites."""

    quad: NDArray[np.float64]  # (4, 2)
    reach: NDArray[np.float64]  # (m, 5) of `fill_reach`


@kernel
def bound_words(beads: Beads, layer: NDArray[np.int32], words: Words) -> None:
    """Write into `words` the bounds of each run of 64 contours."""
    n = len(beads.radius)
    for w in range(len(words.boxes)):
        first = w * WORD
        last = min(n, first + WORD)
        box_points(beads.points, beads.offsets[first], beads.offsets[last], words.boxes[w])
        words.layers[w, 0] = layer[first:last].min()
        words.layers[w, 1] = layer[first:last].max()


@kernel
def segment_segment2(points: NDArray[np.float64], i: int, j: int) -> float:
    """Return the squared XY distance of segments i..i+1 and j..j+1."""
    ax, ay, bx, by = points[i, 0], points[i, 1], points[i + 1, 0], points[i + 1, 1]
    cx, cy, dx, dy = points[j, 0], points[j, 1], points[j + 1, 0], points[j + 1, 1]
    side_c = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    side_d = (bx - ax) * (dy - ay) - (by - ay) * (dx - ax)
    side_a = (dx - cx) * (ay - cy) - (dy - cy) * (ax - cx)
    side_b = (dx - cx) * (by - cy) - (dy - cy) * (bx - cx)
    if side_c * side_d < 0.0 and side_a * side_b < 0.0:
        return 0.0
    return min(
        point_segment2(ax, ay, cx, cy, dx, dy),
        point_segment2(bx, by, cx, cy, dx, dy),
        point_segment2(cx, cy, ax, ay, bx, by),
        point_segment2(dx, dy, ax, ay, bx, by),
    )


@kernel
def boxes_near(
    one: NDArray[np.float64], i: int, other: NDArray[np.float64], j: int, gap: float
) -> bool:
    """Tell whether two boxes come within `gap` of each other along both axes."""
    return bool(
        one[i, 0] <= other[j, 2] + gap
        and other[j, 0] <= one[i, 2] + gap
        and one[i, 1] <= other[j, 3] + gap
        and other[j, 1] <= one[i, 3] + gap
    )


@kernel
def chunks_touch(beads: Beads, a: int, chunk_a: int, b: int, chunk_b: int, gap: float) -> bool:
    """Tell whether segments of two chunks come within `gap`."""
    i_first = beads.offsets[a] + (chunk_a - beads.chunk_offsets[a]) * CHUNK
    j_first = beads.offsets[b] + (chunk_b - beads.chunk_offsets[b]) * CHUNK
    for i in range(i_first, min(i_first + CHUNK, beads.offsets[a + 1] - 1)):
        for j in range(j_first, min(j_first + CHUNK, beads.offsets[b + 1] - 1)):
            if segment_segment2(beads.points, i, j) <= gap * gap:
                return True
    return False


@kernel
def touches(beads: Beads, a: int, b: int, gap: float) -> bool:
    """Tell whether the centrelines of two contours come within `gap` in XY."""
    if not boxes_near(beads.boxes, a, beads.boxes, b, gap):
        return False
    for chunk_a in range(beads.chunk_offsets[a], beads.chunk_offsets[a + 1]):
        if not boxes_near(beads.chunk_boxes, chunk_a, beads.boxes, b, gap):
            continue
        for chunk_b in range(beads.chunk_offsets[b], beads.chunk_offsets[b + 1]):
            if boxes_near(
                beads.chunk_boxes, chunk_a, beads.chunk_boxes, chunk_b, gap
            ) and chunks_touch(beads, a, chunk_a, b, chunk_b, gap):
                return True
    return False


@kernel
def required(
    beads: Beads, rules: ClosureRules, head: PackedHead, a: int, b: int, quad: NDArray[np.float64]
) -> int:
    """Return the kind of the edge (a, b), the least negotiable if several, or 0."""
    if rules.epoch[a] < rules.epoch[b]:
        return STATE
    if blocking_polygon(beads, b, a, head, quad) >= 0:
        return GEOMETRY
    kind = rules.touching[rules.role[a], rules.role[b]]
    if kind and rules.layer[a] == rules.layer[b]:
        gap = (rules.width[a] + rules.width[b]) / 2 + TOUCH_MM
        if touches(beads, a, b, gap):
            return int(kind)
    return 0


@kernel
def fill_reach(beads: Beads, head: PackedHead, b: int, reach: NDArray[np.float64]) -> None:
    """Write where, by boxes, bead b may block each polygon: xmin, ymin, xmax, ymax, zmax."""
    r = beads.radius[b]
    for k in range(len(head.heights)):
        for axis in range(2):
            reach[k, axis] = beads.boxes[b, axis] - head.boxes[k, axis + 2] - r
            reach[k, axis + 2] = beads.boxes[b, axis + 2] - head.boxes[k, axis] + r
        reach[k, 4] = beads.boxes[b, 5] - head.heights[k] - Z_EPS


@kernel
def in_reach(boxes: NDArray[np.float64], i: int, reach: NDArray[np.float64]) -> bool:
    """Tell whether box i lies within any row of `reach`; takes bare arrays to stay fast."""
    for k in range(len(reach)):
        if boxes[i, 4] >= reach[k, 4]:
            return False
        if (
            boxes[i, 0] <= reach[k, 2]
            and boxes[i, 2] >= reach[k, 0]
            and boxes[i, 1] <= reach[k, 3]
            and boxes[i, 3] >= reach[k, 1]
        ):
            return True
    return False


@kernel
def word_concerns(
    rules: ClosureRules, words: Words, reach: NDArray[np.float64], w: int, b: int
) -> bool:
    """Tell whether any contour of run w may have to precede b."""
    return bool(
        rules.epoch[w * WORD] < rules.epoch[b]
        or (rules.keep and words.layers[w, 0] <= rules.layer[b] <= words.layers[w, 1])
        or in_reach(words.boxes, w, reach)
    )


@kernel
def add_edge(edges: Edges, a: int, b: int, kind: int) -> Edges:
    """Append the edge (a, b), in place while there is room, and return the list."""
    at = edges.used[0]
    if at == len(edges.source):
        older = np.empty(2 * at, np.int64)
        source = np.empty(2 * at, np.int32)
        kinds = np.empty(2 * at, np.uint8)
        older[:at] = edges.older
        source[:at] = edges.source
        kinds[:at] = edges.kind
        edges = Edges(edges.latest, older, source, kinds, edges.used)
    edges.older[at] = edges.latest[b]
    edges.source[at] = a
    edges.kind[at] = kind
    edges.latest[b] = at
    edges.used[0] = at + 1
    return edges


@kernel
def inherit(row: NDArray[np.uint64], ancestor: NDArray[np.uint64]) -> None:
    """Or the ancestor's bits into `row`."""
    for w in range(len(row)):
        row[w] |= ancestor[w]


@kernel
def walk_contour(
    rows: NDArray[np.uint64],
    first: int,
    b: int,
    beads: Beads,
    rules: ClosureRules,
    words: Words,
    head: PackedHead,
    edges: Edges,
    scratch: Scratch,
) -> Edges:
    """Find the edges into b from the column block that starts at `first`; fills row b.

    The tests by boxes stand here, not in `required`: they decide almost all of the
    pairs and a call that hands over all the arrays costs more than they do.
    """
    row, boxes, reach = rows[b - first], beads.boxes, scratch.reach
    epoch, layer, role, touching = rules.epoch, rules.layer, rules.role, rules.touching
    fill_reach(beads, head, b, reach)
    last = min(b, first + rows.shape[1] * WORD)
    for w in range((last - 1 - first) // WORD, -1, -1):
        if row[w] == ALL or not word_concerns(rules, words, reach, first // WORD + w, b):
            continue
        base = first + w * WORD
        for i in range(min(WORD, last - base) - 1, -1, -1):
            a = base + i
            if (row[w] >> np.uint64(i)) & np.uint64(1) or not (
                in_reach(boxes, a, reach)
                or epoch[a] < epoch[b]
                or (layer[a] == layer[b] and touching[role[a], role[b]])
            ):
                continue
            kind = required(beads, rules, head, a, b, scratch.quad)
            if kind:
                edges = add_edge(edges, a, b, kind)
                inherit(row[: w + 1], rows[a - first, : w + 1])
                row[w] |= np.uint64(1) << np.uint64(i)
    return edges


@kernel
def walk_columns(
    rows: NDArray[np.uint64],
    first: int,
    beads: Beads,
    rules: ClosureRules,
    words: Words,
    head: PackedHead,
    edges: Edges,
) -> Edges:
    """Find all edges from one column block of ancestors; overwrites `rows`.

    Row b - first holds b's ancestors in first..first + 64 * columns.
    """
    scratch = Scratch(np.empty((4, 2)), np.empty((len(head.heights), 5)))
    for b in range(first, len(beads.radius)):
        row = rows[b - first]
        row[:] = np.uint64(0)
        link = edges.latest[b]
        while link != NO_EDGE:
            inherit(row, rows[edges.source[link] - first])
            link = edges.older[link]
        if b > first:
            edges = walk_contour(rows, first, b, beads, rules, words, head, edges, scratch)
    return edges


@kernel
def close(
    pred_offsets: NDArray[np.int64], preds: NDArray[np.int32], rows: NDArray[np.uint64]
) -> None:
    """Fill `rows` (zeros) with the ancestors of each contour; every pred is smaller."""
    for b in range(len(pred_offsets) - 1):
        for e in range(pred_offsets[b], pred_offsets[b + 1]):
            a = preds[e]
            inherit(rows[b, : a // WORD + 1], rows[a, : a // WORD + 1])
            rows[b, a // WORD] |= np.uint64(1) << np.uint64(a % WORD)
