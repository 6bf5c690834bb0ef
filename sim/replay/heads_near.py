"""How near two heads come, over all that they may do at the same time.

Branch and bound: a tree of boxes over the segments of one head is searched for each action or
rest of the other, and left wherever nothing can be nearer than the nearest pair known. Seen from
one nozzle the other moves within a parallelogram, so two upright parts are as far apart as that
is from their difference, in the plane and in height. This is exact where the height between the
heads does not change, or does not matter since the parts always overlap in height. Else it is a
bound from below.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import shapely

from decmcts.arrays import Floats, Ints
from decmcts.print.machine import Head
from decmcts.print.plan import HeadActions, PlanDocument
from sim.content.paths import Legs
from sim.faults import Gap
from sim.replay.bodies import Stations, concurrent
from sim.replay.boxes import build_tree
from sim.replay.compiled import compiled
from sim.replay.gaps import polygon_gap
from sim.replay.shapes import Part, parts_of
from sim.rules.order import PartialOrder

SAME_MM = 1e-9  # nearer by less than this is not nearer
STACK = 64  # a binary tree of 2**63 leaves is not deeper


@dataclass(frozen=True, slots=True)
class Shapes:
    """Pairs of parts of two heads, each as the other's part seen from this one's."""

    offsets: Ints  # (k + 1,) rows of `xy`
    xy: Floats  # (p, 2) corners of the polygons b - a
    boxes: Floats  # (k + 1, 6) the boxes b - a; the last holds all


@dataclass(frozen=True, slots=True)
class HeadsNear:
    """The nearest pair so far, of all pairs that were looked at."""

    gap_mm: float = np.inf
    heads: tuple[int, int] = (-1, -1)
    does: tuple[tuple[int, bool], ...] = ()  # of both an action, and whether the rest behind it
    at_least: bool = False  # they climb aslant: the gap is no smaller than this


def outermost(parts: list[Part]) -> list[Part]:
    """Return the parts that are not within another one; of equal ones the first."""
    kept: list[Part] = []
    for part in sorted(parts, key=lambda part: part.low - part.high):
        if not any(_holds(other, part) for other in kept):
            kept = [other for other in kept if not _holds(part, other)] + [part]
    return kept


def _holds(part: Part, other: Part) -> bool:
    """Tell whether a part holds another one."""
    if part.low > other.low or part.high < other.high:
        return False
    edge = np.concatenate([part.polygon[1:], part.polygon[:1]]) - part.polygon
    to = other.polygon[:, None] - part.polygon[None]
    return bool((edge[:, 0] * to[:, :, 1] - edge[:, 1] * to[:, :, 0] >= 0.0).all())


def shapes_of(mine: list[Part], theirs: list[Part]) -> Shapes:
    """Return the pairs of two heads' parts."""
    parts = [(a, b) for a in mine for b in theirs]
    if not parts:
        return Shapes(np.zeros(1, np.int64), np.empty((0, 2)), np.zeros((1, 6)))
    apart = [(b.polygon[:, None] - a.polygon[None]).reshape(-1, 2) for a, b in parts]
    pair = np.repeat(np.arange(len(parts)), [len(points) for points in apart])
    hulls = shapely.convex_hull(shapely.multipoints(np.concatenate(apart), indices=pair))
    xy, owner = shapely.get_coordinates(hulls, return_index=True)
    last = np.append(owner[1:] != owner[:-1], True)  # a ring ends where it began
    xy, owner = xy[~last], owner[~last]
    offsets = np.searchsorted(owner, np.arange(len(parts) + 1)).astype(np.int64)
    rows = np.empty((len(parts) + 1, 6))
    rows[:-1, :2] = np.minimum.reduceat(xy, offsets[:-1])
    rows[:-1, 3:5] = np.maximum.reduceat(xy, offsets[:-1])
    rows[:-1, 2] = [b.low - a.high for a, b in parts]
    rows[:-1, 5] = [b.high - a.low for a, b in parts]
    rows[-1] = [*rows[:-1, :3].min(axis=0), *rows[:-1, 3:].max(axis=0)]
    return Shapes(offsets, xy, rows)


def least_gap(
    heads: tuple[Head, ...], all_actions: tuple[HeadActions, ...], order: PartialOrder
) -> HeadsNear:
    """Return the nearest that any two heads may come, in whatever timing."""
    known, parts = HeadsNear(), [outermost(parts_of(head)) for head in heads]
    for r, s in combinations(range(len(heads)), 2):
        for pair in ((r, s), (s, r)):
            shapes = shapes_of(parts[pair[0]], parts[pair[1]])
            rests, *moves = concurrent(heads, all_actions, order, *pair)
            # rests last: each is where an action ended, which is what should be named
            for stations, others in (*moves, rests):
                known = come_nearer(known, pair, stations, others, shapes)
    return known


def come_nearer(
    known: HeadsNear, heads: tuple[int, int], stations: Stations, others: Stations, shapes: Shapes
) -> HeadsNear:
    """Return the nearest pair of a station and a concurrent one of the other head, or `known`."""
    if len(shapes.boxes) == 1 or not len(stations.low) or not len(others.action):
        return known
    best, found = np.array([known.gap_mm]), np.full(3, -1)
    search_nearest(
        (stations.points, stations.offsets, stations.boxes),
        (stations.low, stations.high),
        (others.points, others.offsets, build_tree(others.boxes)),
        (shapes.offsets, shapes.xy, shapes.boxes),
        (best, found),
    )
    i, j, at_least = found.tolist()
    if i < 0:
        return known
    does = (int(stations.action[i]), stations.rest), (int(others.action[j]), others.rest)
    return HeadsNear(float(best[0]), heads, does, bool(at_least))


def nearest_heads(document: PlanDocument, legs: Legs, order: PartialOrder) -> Gap | None:
    """Return how near any two heads may come, over all that they may do at the same time."""
    machine = document.machine
    near = least_gap(machine.heads, legs.all_actions, order)
    if near.heads[0] < 0:
        return None
    names = tuple(machine.heads[h].name for h in near.heads)
    at = tuple(legs.station(h, *does) for h, does in zip(near.heads, near.does, strict=True))
    return Gap(near.gap_mm, machine.head_clearance_mm, names, at, near.at_least)


@compiled
def box_gap(low: Floats, high: Floats, box: Floats) -> float:
    """Return the distance of the box from `low` to `high` to another, (6,)."""
    square = 0.0
    for d in range(3):
        gap = max(0.0, low[d] - box[d + 3], box[d] - high[d])
        square += gap * gap
    return float(np.sqrt(square))


@compiled
def node_gap(mine: Floats, theirs: Floats, low: Floats, high: Floats, boxes: Floats) -> float:
    """Return what two boxes of nozzles are apart at least, by all parts; sets `low` and `high`."""
    for d in range(3):
        low[d], high[d] = mine[d] - theirs[d + 3], mine[d + 3] - theirs[d]
    return box_gap(low, high, boxes[len(boxes) - 1])


@compiled
def parts_gap(a: Floats, b: Floats, low: Floats, high: Floats, k: int, parts: Any) -> float:
    """Return what a pair of parts are apart, moved along two segments, (6,) each.

    It is a lower bound where the height between the two changes on the way (`is_level`).
    """
    offsets, xy, boxes, quad = parts
    for d in range(2):
        quad[0, d], quad[1, d] = a[d] - b[d], a[d + 3] - b[d]
        quad[2, d], quad[3, d] = a[d + 3] - b[d + 3], a[d] - b[d + 3]
    hull = xy[offsets[k] : offsets[k + 1]]
    beside = polygon_gap(quad, 4, hull, len(hull))
    above = max(0.0, low[2] - boxes[k, 5], boxes[k, 2] - high[2])
    return float(np.sqrt(beside * beside + above * above))


@compiled
def is_level(a: Floats, b: Floats, low: Floats, high: Floats, box: Floats) -> bool:
    """Whether `parts_gap` is exact: no height changes aslant, or none that matters."""
    if low[2] >= box[2] and high[2] <= box[5]:
        return True
    one = a[2] == a[5] or (a[0] == a[3] and a[1] == a[4])
    other = b[2] == b[5] or (b[0] == b[3] and b[1] == b[4])
    return bool(one and other)


@compiled
def search_pair(a: Floats, b: Floats, i: int, j: int, spare: Any, shapes: Any, known: Any) -> None:
    """Look at all parts on two segments of stations; mutates `known` where a pair is nearer."""
    best, found = known
    low, high, quad = spare[:3]
    offsets, xy, boxes = shapes
    for k in range(len(boxes) - 1):
        if box_gap(low, high, boxes[k]) >= best[0] - SAME_MM:
            continue
        gap = parts_gap(a, b, low, high, k, (offsets, xy, boxes, quad))
        if gap < best[0] - SAME_MM:
            best[0], found[0], found[1] = gap, i, j
            found[2] = not is_level(a, b, low, high, boxes[k])


@compiled
def take_segment(points: Floats, first: int, last: int, segment: Floats, box: Floats) -> None:
    """Write the segment between two points, and its box; mutates both."""
    for d in range(3):
        segment[d], segment[d + 3] = points[first, d], points[last, d]
        box[d], box[d + 3] = min(segment[d], segment[d + 3]), max(segment[d], segment[d + 3])


@compiled
def search_paths(
    i: int, j: int, mine: Any, theirs: Any, leaf: Floats, spare: Any, shapes: Any, known: Any
) -> None:
    """Look at all pairs of segments of two paths; mutates `known` where one is nearer."""
    points, offsets, _ = mine
    others, begins, _ = theirs
    best, boxes = known[0], shapes[2]
    low, high, _, a, b, a_box, b_box = spare
    end, other_end = offsets[i + 1] - 1, begins[j + 1] - 1
    for p in range(offsets[i], max(end, offsets[i] + 1)):
        take_segment(points, p, min(p + 1, end), a, a_box)
        if node_gap(a_box, leaf, low, high, boxes) >= best[0] - SAME_MM:
            continue
        for q in range(begins[j], max(other_end, begins[j] + 1)):
            take_segment(others, q, min(q + 1, other_end), b, b_box)
            if node_gap(a_box, b_box, low, high, boxes) < best[0] - SAME_MM:
                search_pair(a, b, i, j, spare, shapes, known)


@compiled
def push_children(
    node: int, left: int, right: int, depth: int, stack: Ints, gaps: Floats, asked: Any
) -> int:
    """Put the children of a node that may be nearer on the stack, the nearer on top.

    Mutates stack and gaps, returns the new depth.
    """
    tree, nozzle, begin, end, boxes, best, spare = asked
    before, middle = depth, (left + right) // 2
    for child in range(2):
        a, b = (left, middle) if child == 0 else (middle, right)
        if b <= begin or a >= end:
            continue
        gap, at = node_gap(nozzle, tree[2 * node + child], spare[0], spare[1], boxes), depth
        if gap >= best[0] - SAME_MM:
            continue
        if at > before and gaps[before] < gap:
            for c in range(3):
                stack[at, c] = stack[before, c]
            gaps[at], at = gaps[before], before
        stack[at, 0], stack[at, 1], stack[at, 2], gaps[at] = 2 * node + child, a, b, gap
        depth += 1
    return depth


@compiled
def search_nearest(mine: Any, window: Any, theirs: Any, shapes: Any, known: Any) -> None:
    """Find the nearest pair of segments of concurrent stations; mutates `known`.

    Parameters
    ----------
    mine : (points (p, 3), offsets (n + 1,), nozzle boxes (n, 6)) of the stations
    window : (low (n,), high (n,)) which of the other head's stations count for each
    theirs : (points (q, 3), offsets (k + 1,), tree over their boxes)
    shapes : (offsets, xy, boxes) of `Shapes`
    known : (best (1,), found (3,)): the least gap; its two stations, -1: none nearer, and whether
        it is a bound
    """
    stations, tree, best = mine[2], theirs[2], known[0]
    size = len(tree) // 2
    stack, gaps = np.empty((STACK, 3), np.int64), np.empty(STACK)
    spare = (np.empty(3), np.empty(3), np.empty((4, 2)), np.empty(6), np.empty(6), np.empty(6),
             np.empty(6))  # fmt: skip
    for station in range(len(stations)):
        begin, end = window[0][station], window[1][station]
        if begin >= end:
            continue
        asked = (tree, stations[station], begin, end, shapes[2], best, spare)
        stack[0, 0], stack[0, 1], stack[0, 2], gaps[0], depth = 1, 0, size, -1.0, 1
        while depth:
            depth -= 1
            node, j, right = stack[depth, 0], stack[depth, 1], stack[depth, 2]
            if gaps[depth] >= best[0] - SAME_MM:
                continue
            if node < size:
                depth = push_children(node, j, right, depth, stack, gaps, asked)
            else:
                search_paths(station, j, mine, theirs, tree[node], spare, shapes, known)
