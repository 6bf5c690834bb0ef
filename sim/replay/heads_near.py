"""How near two heads come, over all that they may do at the same time.

Branch and bound: a tree of boxes over the segments of one head is searched for each action or
rest of the other, and left wherever nothing can be nearer than the nearest pair known. Seen from
one nozzle the other moves within a parallelogram, so two upright parts are as far apart as that
is from their difference, in the plane and in height. This is exact where the height between the
heads does not change, or does not matter since the parts always overlap in height. Else it is a
bound, and FCL is asked (`sim.replay.shapes`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
import shapely

from decmcts.print.machine import Head
from decmcts.print.plan import HeadActions, PlanDocument
from sim.arrays import Floats, Ints
from sim.content.paths import Legs
from sim.faults import Gap
from sim.replay.bodies import Stations, action_stations, parked, rest_stations
from sim.replay.boxes import build_tree
from sim.replay.compiled import compiled
from sim.replay.gaps import polygon_gap
from sim.replay.shapes import Part, Solid, parts_of, swept_vertices
from sim.rules.order import PartialOrder

SAME_MM = 1e-9  # nearer by less than this is not nearer
STACK = 64  # a binary tree of 2**63 leaves is not deeper
SLANTING = 256  # pairs of climbing segments that are kept
JUDGED = 32  # of those, how many FCL is asked about at the most


@dataclass(frozen=True, slots=True)
class Shapes:
    """Pairs of parts of two heads, each as the other's part seen from this one's."""

    parts: list[tuple[Part, Part]]
    offsets: Ints  # (k + 1,) rows of `xy`
    xy: Floats  # (p, 2) corners of the polygons b - a
    boxes: Floats  # (k + 1, 6) the boxes b - a; the last holds all


@dataclass(frozen=True, slots=True)
class Slanting:
    """Pairs of segments whose distance is only known to be at least so much."""

    rows: (
        Ints  # (SLANTING, 5) station, the other's, segment of its path, the other's, pair of parts
    )
    bounds: Floats  # (SLANTING,)

    @staticmethod
    def empty() -> Slanting:
        """Return room for as many as are kept."""
        return Slanting(np.empty((SLANTING, 5), np.int64), np.empty(SLANTING))

    def below(self, n: int) -> Iterator[tuple[float, list[int], int]]:
        """Yield of the first n the bound and the row, by bound, counted from 0."""
        for asked, k in enumerate(np.argsort(self.bounds[:n], kind="stable").tolist()):
            yield float(self.bounds[k]), self.rows[k].tolist(), asked


@dataclass(frozen=True, slots=True)
class HeadsNear:
    """The nearest pair so far, of all pairs that were looked at."""

    gap_mm: float = np.inf
    heads: tuple[int, int] = (-1, -1)
    action: int = -1  # of the first, and whether it is the rest behind it
    rest: bool = False
    other_action: int = -1
    other_rest: bool = False
    at_least: bool = False  # there were too many pairs: the gap is no smaller than this


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
        return Shapes([], np.zeros(1, np.int64), np.empty((0, 2)), np.zeros((1, 6)))
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
    return Shapes(parts, offsets, xy, rows)


def least_gap(
    heads: tuple[Head, ...], all_actions: tuple[HeadActions, ...], order: PartialOrder
) -> HeadsNear:
    """Return the nearest that any two heads may come, in whatever timing.

    An action is looked at beside all that may happen meanwhile, a rest behind it only beside
    what may not: the rest is where the action ends.
    """
    known, parts = HeadsNear(), [outermost(parts_of(head)) for head in heads]
    for r, s in combinations(range(len(heads)), 2):
        shapes, mirrored = shapes_of(parts[r], parts[s]), shapes_of(parts[s], parts[r])
        mine = action_stations(all_actions[r], order, r, s)
        theirs = action_stations(all_actions[s], order, s, r)
        known = come_nearer(known, (r, s), mine, theirs, shapes)
        known = come_nearer(known, (r, s), parked(heads[r]), parked(heads[s]), shapes)
        rests = _rests(heads[r], all_actions[r], order, r, s)
        known = come_nearer(known, (r, s), rests, theirs, shapes)
        rests = _rests(heads[s], all_actions[s], order, s, r)
        known = come_nearer(known, (s, r), rests, mine, mirrored)
    return known


def _rests(head: Head, actions: HeadActions, order: PartialOrder, own: int, other: int) -> Stations:
    """Return the rests of a head beside what may begin only once the action before has ended."""
    rests = rest_stations(actions, order, own, other, np.array(head.park))
    return replace(rests, low=np.concatenate([[0], order.following(own, other)]))


def come_nearer(
    known: HeadsNear, heads: tuple[int, int], stations: Stations, others: Stations, shapes: Shapes
) -> HeadsNear:
    """Return the nearest pair of a station and a concurrent one of the other head, or `known`."""
    if not shapes.parts or not len(stations.low) or not len(others.action):
        return known
    best, found, slanting = np.array([known.gap_mm, np.inf]), np.full(3, -1), Slanting.empty()
    search_nearest(
        (stations.points, stations.offsets, stations.boxes),
        (stations.low, stations.high),
        (others.points, others.offsets, build_tree(others.boxes)),
        (shapes.offsets, shapes.xy, shapes.boxes),
        (best, found, slanting.rows, slanting.bounds),
    )
    i, j, gap, at_least = int(found[0]), int(found[1]), float(best[0]), known.at_least
    for bound, row, asked in slanting.below(int(found[2]) + 1):
        if bound >= gap - SAME_MM:
            break
        near = _exactly(stations, others, row, shapes) if asked < JUDGED else bound
        if near < gap - SAME_MM:
            gap, i, j, at_least = near, row[0], row[1], at_least or asked >= JUDGED
    if best[1] < gap - SAME_MM:
        gap, at_least = float(best[1]), True
    if i < 0:
        return replace(known, gap_mm=gap, at_least=at_least)
    action, other = int(stations.action[i]), int(others.action[j])
    return HeadsNear(gap, heads, action, stations.rest, other, others.rest, at_least)


def _exactly(stations: Stations, others: Stations, row: list[int], shapes: Shapes) -> float:
    """Return the distance of two parts swept along a segment each."""
    i, j, a, b, k = row
    mine, theirs = stations.path(i)[a : a + 2], others.path(j)[b : b + 2]
    one, other = (
        Solid(swept_vertices(part.vertices(), path[0], path[-1]))
        for part, path in zip(shapes.parts[k], (mine, theirs), strict=True)
    )
    return one.distance(other)


def nearest_heads(document: PlanDocument, legs: Legs, order: PartialOrder) -> Gap | None:
    """Return how near any two heads may come, over all that they may do at the same time."""
    machine = document.machine
    near = least_gap(machine.heads, legs.all_actions, order)
    if near.heads[0] < 0:
        return None
    r, s = near.heads
    return Gap(
        near.gap_mm,
        machine.head_clearance_mm,
        (machine.heads[r].name, machine.heads[s].name),
        (
            legs.station(r, near.action, near.rest),
            legs.station(s, near.other_action, near.other_rest),
        ),
        near.at_least,
    )


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
def search_pair(a: Floats, b: Floats, row: Any, spare: Any, shapes: Any, known: Any) -> None:
    """Look at all pairs of parts of two segments; mutates `known` where one is nearer.

    `row` has the two stations and the segments of their paths.
    """
    best, found, rows, bounds = known
    low, high, quad = spare[:3]
    offsets, xy, boxes = shapes
    for k in range(len(boxes) - 1):
        if box_gap(low, high, boxes[k]) >= best[0] - SAME_MM:
            continue
        gap = parts_gap(a, b, low, high, k, (offsets, xy, boxes, quad))
        if gap >= best[0] - SAME_MM:
            continue
        if is_level(a, b, low, high, boxes[k]):
            best[0], found[0], found[1] = gap, row[0], row[1]
        elif found[2] + 1 < len(bounds):
            found[2] += 1
            bounds[found[2]] = gap
            for c in range(4):
                rows[found[2], c] = row[c]
            rows[found[2], 4] = k
        else:
            best[1] = min(best[1], gap)


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
                row = (i, j, p - offsets[i], q - begins[j])
                search_pair(a, b, row, spare, shapes, known)


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
    known : (best (2,), found (3,), rows, bounds): the least gap, and the least of those that were
        not looked at; its two stations, -1: none nearer, and the last of the rows that are
        written; pairs that FCL has to look at (`Slanting`)
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
