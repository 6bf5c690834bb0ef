"""Head against head, for every execution the partial order allows: J3, and the rails.

Two actions of different heads that the order does not separate may run at the
same time, and a head rests where an action ended until its next one begins. All
such pairs are checked without looking at each: a head is a chain of actions, those that may
run at the same time as one action are an interval of the other chain, and a tree of
bounding boxes over the chain finds the members of the interval that come near.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, permutations, product

import numpy as np

from decmcts.print.machine import Head
from decmcts.print.plan import HeadActions, PlanDocument
from sim.arrays import Floats, Ints
from sim.content.paths import Legs
from sim.faults import LIMIT, Fault, FaultKind, listed
from sim.replay.boxes import near_in_windows
from sim.replay.shapes import Solid, Vertices, parts_of, separations_between, swept_vertices
from sim.rules.order import PartialOrder

TOLERANCE_MM = 1e-6
NamedParts = list[tuple[str, Vertices]]  # name and corners of each part of a head


@dataclass(frozen=True, slots=True)
class Stations:
    """Actions or rests of one head, each with what another head may do meanwhile.

    What may happen meanwhile is an interval [low, high) of the other's actions.
    """

    points: Floats  # (k, 3) of all paths, one after the other
    offsets: Ints  # (n + 1,) rows of `points`
    boxes: Floats  # (n, 6) of the nozzle: low, high
    low: Ints  # (n,) first action of the other head
    high: Ints  # (n,) one past the last
    action: Ints  # (n,) own action, or the one a rest comes after; -1 before the first
    rest: bool

    def path(self, i: int) -> Floats:
        """Return the path of one, (k, 3)."""
        return self.points[self.offsets[i] : self.offsets[i + 1]]


def boxes_of(points: Floats, offsets: Ints) -> Floats:
    """Return the bounding boxes of nozzle paths, none empty, (n, 6)."""
    if len(offsets) < 2:
        return np.empty((0, 6))
    return np.hstack([f.reduceat(points, offsets[:-1]) for f in (np.minimum, np.maximum)])


def action_stations(actions: HeadActions, order: PartialOrder, head: int, other: int) -> Stations:
    """Return every action of a head with the actions of `other` it is not ordered against."""
    points, offsets = actions.path, actions.path_offsets
    low, high = order.preceding(head, other), order.following(head, other)
    boxes = boxes_of(points, offsets)
    return Stations(points, offsets, boxes, low, high, np.arange(len(actions)), False)


def rest_stations(
    actions: HeadActions, order: PartialOrder, head: int, other: int, park: Floats
) -> Stations:
    """Return every rest of a head with the actions of `other` that may pass by then.

    A rest ends when the next action begins, so only what precedes the action
    before it or follows the action after it is excluded.
    """
    k, n_other = len(actions), len(order.clocks[other])
    points = np.concatenate([park[None, :], actions.path[actions.path_offsets[1:] - 1]])
    low = np.concatenate([[0], order.preceding(head, other)])
    high = np.concatenate([order.following(head, other), [n_other]])
    boxes = np.hstack([points, points])
    return Stations(points, np.arange(k + 2), boxes, low, high, np.arange(-1, k), True)


def concurrent(
    heads: tuple[Head, ...],
    all_actions: tuple[HeadActions, ...],
    order: PartialOrder,
    r: int,
    s: int,
) -> Iterator[tuple[Stations, Stations]]:
    """Yield what head r does beside what head s may do meanwhile, each pair of them once.

    Asked for (r, s) and (s, r), this covers all: whenever two heads rest at the
    same time, the one that came last moved while the other rested, or neither
    has moved yet.
    """
    theirs = action_stations(all_actions[s], order, s, r)
    rests = rest_stations(all_actions[r], order, r, s, np.array(heads[r].park))
    yield rests, theirs
    if r < s:
        yield action_stations(all_actions[r], order, r, s), theirs
        yield parked(heads[r]), parked(heads[s])


def parked(head: Head) -> Stations:
    """Return the rest of a head before its first action, beside one of the other head."""
    point, one = np.array([head.park], np.float64), np.array([0])
    boxes = np.hstack([point, point])
    return Stations(point, np.arange(2), boxes, one, one + 1, one - 1, True)


def check_heads(document: PlanDocument, legs: Legs, order: PartialOrder) -> list[Fault]:
    """J3: heads that may move or rest at the same time keep their distance."""
    machine, lines = document.machine, list[str]()
    parts = [[(part.name, part.vertices()) for part in parts_of(head)] for head in machine.heads]
    for r, s in permutations(range(len(legs.all_actions)), 2):
        for stations, others in concurrent(machine.heads, legs.all_actions, order, r, s):
            clashes = find_clashes(
                stations, others, parts[r], parts[s], machine.head_clearance_mm, 2 * LIMIT
            )
            lines += [
                f"{legs.station(r, int(stations.action[i]), stations.rest)} and "
                f"{legs.station(s, int(others.action[j]), others.rest)} may happen together "
                f"and come within {gap:.3f} mm ({part}, {other})"
                for (i, j), (gap, part, other) in clashes.items()
            ]
    return listed(FaultKind.HEAD_HEAD, lines)


def check_rail(document: PlanDocument, legs: Legs, order: PartialOrder) -> list[Fault]:
    """Heads on one rail keep their order and their separation, whatever the timing."""
    heads, lines = document.machine.heads, list[str]()
    for r, s in permutations(range(len(legs.all_actions)), 2):
        for axis, side, least in separations_between(document.machine, heads[r], heads[s]):
            for stations, others in concurrent(heads, legs.all_actions, order, r, s):
                breaks = find_rail_breaks(
                    stations, others, axis=axis, separation_mm=least, below=side > 0.0,
                    limit=2 * LIMIT,
                )  # fmt: skip
                lines += [
                    f"{legs.station(r, a, stations.rest)} and {legs.station(s, b, others.rest)} "
                    f"may happen together and be {gap:.3f} mm apart along {'xy'[axis]}, "
                    f"less than {least:g} mm"
                    for a, b, gap in breaks
                ]
    return listed(FaultKind.RAIL, lines)


def count_pairs(legs: Legs, order: PartialOrder) -> int:
    """Return how many pairs of actions of different heads may run at the same time.

    Actions that others wait for midway count leg by leg.
    """
    pairs = combinations(range(len(legs.all_actions)), 2)
    return sum(int((order.following(r, s) - order.preceding(r, s)).sum()) for r, s in pairs)


def find_clashes(
    stations: Stations, others: Stations, parts: NamedParts, other_parts: NamedParts,
    clearance_mm: float, limit: int,
) -> dict[tuple[int, int], tuple[float, str, str]]:  # fmt: skip
    """Return how near, and with what, stations come too near to concurrent ones of another head."""
    reach, clashes = clearance_mm - TOLERANCE_MM, dict[tuple[int, int], tuple[float, str, str]]()
    if not parts or not other_parts:
        return clashes
    mine = _grown(stations.boxes, np.concatenate([v for _, v in parts]), reach)
    theirs = _grown(others.boxes, np.concatenate([v for _, v in other_parts]), 0.0)
    for pairs in near_in_windows(mine, stations.low, stations.high, theirs):
        for (name, a), (other, b) in product(parts, other_parts):
            for i, j in _near_pairs(pairs, stations, others, a, b, reach):
                if len(clashes) >= limit:
                    return clashes
                gap = path_gap(stations.path(i), a, others.path(j), b, reach)
                if gap < reach:
                    clashes.setdefault((i, j), (gap, name, other))
    return clashes


def _grown(boxes: Floats, shape: Vertices, margin: float) -> Floats:
    """Return the boxes of a shape whose nozzle stays within the given boxes."""
    return np.asarray(boxes + np.hstack([shape.min(axis=0) - margin, shape.max(axis=0) + margin]))


def _near_pairs(
    pairs: Ints, stations: Stations, others: Stations, a: Vertices, b: Vertices, reach: float
) -> list[tuple[int, int]]:
    """Return the pairs in which these two parts' swept bounding boxes come nearer than `reach`."""
    mine = _grown(stations.boxes[pairs[:, 0]], a, reach)
    theirs = _grown(others.boxes[pairs[:, 1]], b, 0.0)
    near = (mine[:, :3] < theirs[:, 3:]) & (theirs[:, :3] < mine[:, 3:])
    return [(int(i), int(j)) for i, j in pairs[near.all(axis=1)]]


def find_rail_breaks(
    stations: Stations,
    others: Stations,
    *,
    axis: int,
    separation_mm: float,
    below: bool,
    limit: int,
) -> list[tuple[int, int, float]]:
    """Return (own action, other action, distance) of pairs that break the order of a rail.

    Parameters
    ----------
    stations, others : Stations
    axis : 0 for X, 1 for Y
    separation_mm : least distance of the two nozzles along the axis
    below : whether the first head is the one with the smaller coordinate
    limit : stop after this many
    """
    boxes = np.empty_like(stations.boxes)
    boxes[:, :3], boxes[:, 3:] = -np.inf, np.inf
    side = separation_mm - TOLERANCE_MM
    if below:
        boxes[:, axis + 3] = stations.boxes[:, axis + 3] + side
    else:
        boxes[:, axis] = stations.boxes[:, axis] - side
    breaks: list[tuple[int, int, float]] = []
    for pairs in near_in_windows(boxes, stations.low, stations.high, others.boxes):
        for i, j in pairs[: limit - len(breaks)].tolist():
            if below:
                gap = others.boxes[j, axis] - stations.boxes[i, axis + 3]
            else:
                gap = stations.boxes[i, axis] - others.boxes[j, axis + 3]
            breaks.append((int(stations.action[i]), int(others.action[j]), float(gap)))
        if len(breaks) >= limit:
            break
    return breaks


def path_gap(
    path: Floats, shape: Vertices, other: Floats, other_shape: Vertices, reach: float
) -> float:
    """Return the least distance of two swept shapes, as far as it is below `reach`."""
    least = np.inf
    for i, j in _near_segments(path, shape, other, other_shape, reach):
        least = min(
            least, _segment_solid(path, i, shape).distance(_segment_solid(other, j, other_shape))
        )
        if least == 0.0:
            break
    return float(least)


def _segment_solid(path: Floats, i: int, shape: Vertices) -> Solid:
    end = path[min(i + 1, len(path) - 1)]
    return Solid(swept_vertices(shape, path[i], end))


def _segment_boxes(path: Floats, shape: Vertices) -> Floats:
    start, end = (path[:-1], path[1:]) if len(path) > 1 else (path, path)
    low, high = np.minimum(start, end), np.maximum(start, end)
    return np.hstack([low + shape.min(axis=0), high + shape.max(axis=0)])


def _near_segments(
    path: Floats, shape: Vertices, other: Floats, other_shape: Vertices, reach: float
) -> Iterator[tuple[int, int]]:
    """Yield pairs of segments whose swept boxes come nearer than `reach`."""
    theirs = _segment_boxes(other, other_shape)
    for i, box in enumerate(_segment_boxes(path, shape)):
        near = (theirs[:, :3] < box[3:] + reach) & (theirs[:, 3:] > box[:3] - reach)
        for j in np.nonzero(near.all(axis=1))[0].tolist():
            yield i, j
