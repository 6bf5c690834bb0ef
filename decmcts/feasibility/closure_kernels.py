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

from decmcts.arrays import Floats, Int32s, Ints
from decmcts.compiled import kernel
from decmcts.feasibility.clearance_kernels import (
    CHUNK,
    Z_EPS,
    Centrelines,
    PackedHead,
    contact_depth,
    point_segment2,
)

WORD = 64
GEOMETRY, STATE = 1, 3  # decmcts.feasibility.graph.EdgeKind
TOUCH_MM = 0.05  # beads nearer than this touch
NO_EDGE = -1
ALL = np.uint64(2**64 - 1)


class ClosureRules(NamedTuple):
    """What besides geometry orders contours."""

    layer: Int32s  # (n,)
    role: NDArray[np.int8]  # (n,)
    epoch: Int32s  # (n,) non-decreasing
    width: Floats  # (n,) mm
    of: Int32s  # (n,) pieces of one contour keep no order because they touch
    touching: NDArray[np.uint8]  # (roles, roles) kind of edge between touching contours, 0: none
    keep: bool  # whether any entry of `touching` is not 0


class Words(NamedTuple):
    """Bounds of each run of 64 contours, to skip the run as a whole."""

    boxes: Floats  # (n_words, 6)
    layers: Int32s  # (n_words, 2) lowest, highest


class Edges(NamedTuple):
    """A growing list of edges, linked by their later end."""

    latest: Ints  # (n,) newest edge into b, NO_EDGE if none
    older: Ints  # (capacity,) next older edge into the same b
    source: Int32s  # (capacity,) a
    kind: NDArray[np.uint8]  # (capacity,)
    used: Ints  # (1,) how many of the capacity


class Scratch(NamedTuple):
    """Memory of the walk; all but the sides is overwritten by each contour."""

    quad: Floats  # (4, 2)
    reach: Floats  # (m, 5) of `fill_reach`
    sides: Floats  # (6, n) of the contours' boxes, for loops over one side
    word_sides: Floats  # (6, n_words)
    words: NDArray[np.uint64]  # (n_words,) of `mark_words`
    contours: NDArray[np.uint64]  # (WORD,) of `mark_contours`
    source: Int32s  # (n,) a of the edges into one contour
    kind: NDArray[np.uint8]  # (n,)


@kernel
def segment_segment2(points: Floats, i: int, j: int) -> float:
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
def boxes_near(one: Floats, i: int, other: Floats, j: int, gap: float) -> bool:
    """Tell whether two boxes come within `gap` of each other along both axes."""
    return bool(
        one[i, 0] <= other[j, 2] + gap
        and other[j, 0] <= one[i, 2] + gap
        and one[i, 1] <= other[j, 3] + gap
        and other[j, 1] <= one[i, 3] + gap
    )


@kernel
def chunks_touch(
    beads: Centrelines, a: int, chunk_a: int, b: int, chunk_b: int, gap: float
) -> bool:
    """Tell whether segments of two chunks come within `gap`."""
    i_first = beads.offsets[a] + (chunk_a - beads.chunk_offsets[a]) * CHUNK
    j_first = beads.offsets[b] + (chunk_b - beads.chunk_offsets[b]) * CHUNK
    for i in range(i_first, min(i_first + CHUNK, beads.offsets[a + 1] - 1)):
        for j in range(j_first, min(j_first + CHUNK, beads.offsets[b + 1] - 1)):
            if segment_segment2(beads.points, i, j) <= gap * gap:
                return True
    return False


@kernel
def touches(beads: Centrelines, a: int, b: int, gap: float) -> bool:
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
    beads: Centrelines,
    rules: ClosureRules,
    head: PackedHead,
    a: int,
    b: int,
    quad: Floats,
) -> int:
    """Return the kind of the edge (a, b), the least negotiable if several, or 0."""
    if rules.epoch[a] < rules.epoch[b]:
        return STATE
    if contact_depth(beads, b, a, head, 0.0, quad)[1] >= 0:  # the first depth ends it
        return GEOMETRY
    kind = rules.touching[rules.role[a], rules.role[b]]
    if kind and rules.layer[a] == rules.layer[b] and rules.of[a] != rules.of[b]:
        gap = (rules.width[a] + rules.width[b]) / 2 + TOUCH_MM
        if touches(beads, a, b, gap):
            return int(kind)
    return 0


@kernel
def fill_reach(beads: Centrelines, head: PackedHead, b: int, reach: Floats) -> None:
    """Write where, by boxes, bead b may block each polygon: xmin, ymin, xmax, ymax, zmax."""
    r = beads.radius[b]
    for k in range(len(head.heights)):
        for axis in range(2):
            reach[k, axis] = beads.boxes[b, axis] - head.boxes[k, axis + 2] - r
            reach[k, axis + 2] = beads.boxes[b, axis + 2] - head.boxes[k, axis] + r
        reach[k, 4] = beads.boxes[b, 5] - head.heights[k] - Z_EPS


@kernel
def add_in_reach(sides: Floats, first: int, reach: Floats, k: int, may: NDArray[np.uint64]) -> None:
    """Set `may` to 1 for boxes from `first` on that lie within row k of `reach`.

    A loop without branches over one side an array: the compiler takes several boxes at a time.
    """
    last = first + len(may)
    x_low, y_low, z_low = sides[0, first:last], sides[1, first:last], sides[4, first:last]
    x_high, y_high = sides[2, first:last], sides[3, first:last]
    x_least, y_least, x_most, y_most = reach[k, 0], reach[k, 1], reach[k, 2], reach[k, 3]
    z_most = reach[k, 4]
    for i in range(len(may)):
        may[i] |= np.uint64(
            (z_low[i] < z_most)
            & (x_low[i] <= x_most)
            & (x_high[i] >= x_least)
            & (y_low[i] <= y_most)
            & (y_high[i] >= y_least)
        )


@kernel
def mark_words(
    rules: ClosureRules, words: Words, b: int, scratch: Scratch, first: int, may: NDArray[np.uint64]
) -> None:
    """Write into `may` whether any contour of runs from `first` on may have to precede b."""
    epoch, layer = rules.epoch[b], rules.layer[b]
    for w in range(len(may)):
        may[w] = rules.epoch[(first + w) * WORD] < epoch or (
            rules.keep and words.layers[first + w, 0] <= layer <= words.layers[first + w, 1]
        )
    for k in range(len(scratch.reach)):
        add_in_reach(scratch.word_sides, first, scratch.reach, k, may)


@kernel
def mark_contours(
    rules: ClosureRules, words: Words, b: int, scratch: Scratch, w: int, may: NDArray[np.uint64]
) -> None:
    """Write into `may` which contours of run w may have to precede b."""
    first, epoch, layer, role = w * WORD, rules.epoch[b], rules.layer[b], rules.role[b]
    of = rules.of[b]
    may[:] = 0
    if rules.epoch[first] < epoch:
        for i in range(len(may)):
            may[i] = rules.epoch[first + i] < epoch
    if rules.keep and words.layers[w, 0] <= layer <= words.layers[w, 1]:
        for i in range(len(may)):
            a = first + i
            if (
                rules.layer[a] == layer
                and rules.of[a] != of
                and rules.touching[rules.role[a], role] != 0
            ):
                may[i] = 1
    for k in range(len(scratch.reach)):
        if row_reaches(words.boxes, w, scratch.reach, k):
            add_in_reach(scratch.sides, first, scratch.reach, k, may)


@kernel
def row_reaches(boxes: Floats, i: int, reach: Floats, k: int) -> bool:
    """Tell whether box i lies within row k of `reach`."""
    return bool(
        boxes[i, 4] < reach[k, 4]
        and boxes[i, 0] <= reach[k, 2]
        and boxes[i, 2] >= reach[k, 0]
        and boxes[i, 1] <= reach[k, 3]
        and boxes[i, 3] >= reach[k, 1]
    )


@kernel
def with_room(edges: Edges, more: int) -> Edges:
    """Return the list with room for more edges; the same one if it has it."""
    used = edges.used[0]
    if used + more <= len(edges.source):
        return edges
    room = 2 * (used + more)
    older = np.empty(room, np.int64)
    source = np.empty(room, np.int32)
    kind = np.empty(room, np.uint8)
    older[:used] = edges.older[:used]
    source[:used] = edges.source[:used]
    kind[:used] = edges.kind[:used]
    return Edges(edges.latest, older, source, kind, edges.used)


@kernel
def add_edges(edges: Edges, b: int, scratch: Scratch, count: int) -> None:
    """Append the edges found into b, in place: there is room."""
    for k in range(count):
        at = edges.used[0]
        edges.older[at] = edges.latest[b]
        edges.source[at] = scratch.source[k]
        edges.kind[at] = scratch.kind[k]
        edges.latest[b] = at
        edges.used[0] = at + 1


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
    beads: Centrelines,
    rules: ClosureRules,
    words: Words,
    head: PackedHead,
    scratch: Scratch,
) -> int:
    """Find the edges into b from the column block that starts at `first`; fills row b.

    Writes them into `scratch` and returns how many. Boxes are tested first, for many contours
    at a time: they decide almost all of the pairs.
    """
    count = 0
    row = rows[b - first]
    fill_reach(beads, head, b, scratch.reach)
    last = min(b, first + rows.shape[1] * WORD)
    concerned = scratch.words[: (last - 1 - first) // WORD + 1]
    mark_words(rules, words, b, scratch, first // WORD, concerned)
    for w in range(len(concerned) - 1, -1, -1):
        if row[w] == ALL or not concerned[w]:
            continue
        base = first + w * WORD
        may = scratch.contours[: min(WORD, last - base)]
        mark_contours(rules, words, b, scratch, first // WORD + w, may)
        for i in range(len(may) - 1, -1, -1):
            if not may[i] or (row[w] >> np.uint64(i)) & np.uint64(1):
                continue
            a = base + i
            kind = required(beads, rules, head, a, b, scratch.quad)
            if kind:
                scratch.source[count] = a
                scratch.kind[count] = kind
                count += 1
                inherit(row[: w + 1], rows[a - first, : w + 1])
                row[w] |= np.uint64(1) << np.uint64(i)
    return count


@kernel
def walk_columns(
    rows: NDArray[np.uint64],
    first: int,
    beads: Centrelines,
    rules: ClosureRules,
    words: Words,
    head: PackedHead,
    edges: Edges,
) -> Edges:
    """Find all edges from one column block of ancestors; overwrites `rows`.

    Row b - first holds b's ancestors in first..first + 64 * columns.
    """
    scratch = Scratch(
        np.empty((4, 2)),
        np.empty((len(head.heights), 5)),
        np.ascontiguousarray(beads.boxes.T),
        np.ascontiguousarray(words.boxes.T),
        np.empty(len(words.boxes), np.uint64),
        np.empty(WORD, np.uint64),
        np.empty(len(beads.radius), np.int32),
        np.empty(len(beads.radius), np.uint8),
    )
    for b in range(first, len(beads.radius)):
        row = rows[b - first]
        row[:] = np.uint64(0)
        link = edges.latest[b]
        while link != NO_EDGE:
            inherit(row, rows[edges.source[link] - first])
            link = edges.older[link]
        if b > first:
            count = walk_contour(rows, first, b, beads, rules, words, head, scratch)
            edges = with_room(edges, count)
            add_edges(edges, b, scratch, count)
    return edges


@kernel
def close(pred_offsets: Ints, preds: Int32s, rows: NDArray[np.uint64]) -> None:
    """Fill `rows` (zeros) with the ancestors of each contour; every pred is smaller."""
    for b in range(len(pred_offsets) - 1):
        for e in range(pred_offsets[b], pred_offsets[b + 1]):
            a = preds[e]
            inherit(rows[b, : a // WORD + 1], rows[a, : a // WORD + 1])
            rows[b, a // WORD] |= np.uint64(1) << np.uint64(a % WORD)
