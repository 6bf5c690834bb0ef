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

from decmcts.arrays import Floats, Ints
from decmcts.print.machine import Head
from decmcts.print.plan import HeadActions, PlanDocument
from sim.content.paths import Legs
from sim.faults import LIMIT, Fault, FaultKind, listed
from sim.replay.boxes import near_in_windows
from sim.replay.shapes import Solid, Vertices, parts_of, separations_between, swept_vertices
from sim.rules.order import PartialOrder

TOLERANCE_MM = 1e-6
MOST = 2 * LIMIT  # pairs that are found of what two heads do: more is not listed
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


def action_stations(actions: HeadActions, order: PartialOrder, head: int, other: int) -> Stations:
    """Return every action of a head with the actions of `other` it is not ordered against."""
    points, offsets = actions.path, actions.path_offsets
    boxes = np.hstack([f.reduceat(points, offsets[:-1]) for f in (np.minimum, np.maximum)])
    low, high = order.preceding(head, other), order.following(head, other)
    return Stations(points, offsets, boxes, low, high, np.arange(len(actions)), False)


def rest_stations(
    actions: HeadActions, order: PartialOrder, head: int, other: int, park: Floats
) -> Stations:
    """Return every rest of a head with the actions of `other` that may pass by then.

    A rest ends when the next action begins, so only what precedes the action
    before it or follows the action after it is excluded.
    """
    points = np.concatenate([park[None, :], actions.path[actions.path_offsets[1:] - 1]])
    low = np.concatenate([[0], order.preceding(head, other)])
    high = np.concatenate([order.following(head, other), [len(order.clocks[other])]])
    k, boxes = len(actions), np.hstack([points, points])
    return Stations(points, np.arange(k + 2), boxes, low, high, np.arange(-1, k), True)


def concurrent(
    heads: tuple[Head, ...],
    all_actions: tuple[HeadActions, ...],
    order: PartialOrder,
    r: int,
    s: int,
) -> Iterator[tuple[Stations, Stations]]:
    """Yield what head r does beside what head s may do meanwhile, rests first, each pair once.

    Asked for (r, s) and (s, r), this covers all: whenever two heads rest at the
    same time, the one that came last moved while the other rested, or neither
    has moved yet.
    """
    theirs = action_stations(all_actions[s], order, s, r)
    yield rest_stations(all_actions[r], order, r, s, np.array(heads[r].park)), theirs
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
            clashes = find_clashes(stations, others, parts[r], parts[s], machine.head_clearance_mm)
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
                lines += [
                    f"{legs.station(r, int(stations.action[i]), stations.rest)} and "
                    f"{legs.station(s, int(others.action[j]), others.rest)} may happen together "
                    f"and be {gap:.3f} mm apart along {'xy'[axis]}, less than {least:g} mm"
                    for i, j, gap in find_rail_breaks(stations, others, axis, side, least)
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
    clearance_mm: float,
) -> dict[tuple[int, int], tuple[float, str, str]]:  # fmt: skip
    """Return how near, and with what, stations come too near to concurrent ones of another head.

    `MOST` at the most are found.
    """
    reach, clashes = clearance_mm - TOLERANCE_MM, dict[tuple[int, int], tuple[float, str, str]]()
    if not parts or not other_parts:
        return clashes
    mine = _grown(stations.boxes, np.concatenate([v for _, v in parts]), reach)
    theirs = _grown(others.boxes, np.concatenate([v for _, v in other_parts]), 0.0)
    for pairs in near_in_windows(mine, stations.low, stations.high, theirs):
        for (name, a), (other, b) in product(parts, other_parts):
            for i, j in _near_pairs(pairs, stations, others, a, b, reach):
                if len(clashes) >= MOST:
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
    stations: Stations, others: Stations, axis: int, side: float, separation_mm: float
) -> list[tuple[int, int, float]]:
    """Return pairs that break the order of a rail, and the distance of their nozzles; `MOST`.

    `side` is 1 where the other head has the greater coordinate, else -1.
    """
    inner, outer = (axis + 3, axis) if side > 0.0 else (axis, axis + 3)
    edge, facing = stations.boxes[:, inner], others.boxes[:, outer]
    boxes = np.tile([-np.inf] * 3 + [np.inf] * 3, (len(edge), 1))
    boxes[:, inner] = edge + side * (separation_mm - TOLERANCE_MM)
    breaks: list[tuple[int, int, float]] = []
    for pairs in near_in_windows(boxes, stations.low, stations.high, others.boxes):
        for i, j in pairs[: MOST - len(breaks)].tolist():
            breaks.append((i, j, side * float(facing[j] - edge[i])))
        if len(breaks) >= MOST:
            break
    return breaks


def path_gap(
    path: Floats, shape: Vertices, other: Floats, other_shape: Vertices, reach: float
) -> float:
    """Return the least distance of two swept shapes, as far as it is below `reach`."""
    least, mine, theirs = np.inf, segments(path), segments(other)
    for i, near in near_boxes(around(mine, shape), around(theirs, other_shape), reach):
        solid = Solid(swept_vertices(shape, *mine[i]))
        for j in near:
            least = min(least, solid.distance(Solid(swept_vertices(other_shape, *theirs[j]))))
            if least == 0.0:
                return least
    return float(least)


def segments(path: Floats) -> Floats:
    """Return both ends of each segment of a path, (n, 2, 3); of one point a segment at it."""
    return np.stack([path[:-1], path[1:]] if len(path) > 1 else [path, path], axis=1)


def around(places: Floats, shape: Vertices) -> Floats:
    """Return boxes round a shape whose tip is at these places, (n, k, 3): low and high, (n, 6)."""
    return _grown(np.hstack([places.min(axis=1), places.max(axis=1)]), shape, 0.0)


def near_boxes(ours: Floats, theirs: Floats, reach: float) -> Iterator[tuple[int, list[int]]]:
    """Yield each of our boxes that comes nearer than `reach` to some of theirs, with those."""
    high, low = theirs[:, 3:].max(axis=0), theirs[:, :3].min(axis=0)
    some = (ours[:, :3] - reach < high) & (low < ours[:, 3:] + reach)
    for i in np.flatnonzero(some.all(axis=1)).tolist():
        near = (ours[i, :3] - reach < theirs[:, 3:]) & (theirs[:, :3] < ours[i, 3:] + reach)
        if found := np.flatnonzero(near.all(axis=1)).tolist():
            yield i, found
