"""What differs between two plans of one print, action by action, and where they cross walls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from decmcts._kernels.geometry.walls import END_MM, Walls, over_walls
from decmcts.print.contours import Contours
from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from decmcts.print.walls import OUTER, outer_walls
from sim.arrays import Flags, Floats, Ints
from sim.pictures.layer_travels import both_ends, in_no_place_of

STRIP = np.array([1e5, 0.0])  # mm, more than any bed: each level has a part of the plane
NO_POINTS = np.zeros((0, 3))
OTHER = np.uint8(1)  # a travel between places that the other plan has no travel between
OVER_WALL = np.uint8(2)  # a travel that crosses an outer wall
MOVED = np.uint8(4)  # a contour printed by another head, or much earlier or later in the order
CROSSED = np.uint8(8)  # an outer wall that a travel of this plan crosses
MUCH = 0.01  # of the order, by which a contour has moved
NOWHERE = np.zeros((0, 6), np.int64)  # both ends of no travel

OfHeads = tuple[NDArray[np.uint8], ...]  # flags of the actions of each head


def flags_of(before: PlanDocument, after: PlanDocument) -> tuple[OfHeads, OfHeads]:
    """Return for each head of both plans the flags of its actions, (k,) each."""
    plans = [document.plan.heads for document in (before, after)]
    found = [[np.zeros(len(actions), np.uint8) for actions in plan] for plan in plans]
    walls, moved = outer_walls(before.contours), moved_contours(before, after)
    ends = [[_travels(actions) for actions in plan] for plan in plans]
    for k in (0, 1):
        others = np.concatenate([NOWHERE, *(there for _, there in ends[1 - k])])
        for flags, (rows, mine) in zip(found[k], ends[k], strict=True):
            flags[rows[in_no_place_of(mine, others)]] |= OTHER
        over = [legs_over(walls, actions) for actions in plans[k]]
        of_contours = crossed_walls(before.contours, over) * CROSSED + moved * MOVED
        for flags, legs, actions in zip(found[k], over, plans[k], strict=True):
            flags[legs.action] |= OVER_WALL
            printing = actions.kind == ActionKind.PRINT
            flags[printing] |= of_contours[actions.contour[printing]]
    return tuple(found[0]), tuple(found[1])


def _travels(actions: HeadActions) -> tuple[Ints, Ints]:
    """Return the actions that travel, (k,), and where both ends of each are, (k, 6)."""
    rows = np.flatnonzero((actions.kind == ActionKind.TRAVEL) | (actions.kind == ActionKind.PARK))
    first, last = actions.path_offsets[rows], actions.path_offsets[rows + 1] - 1
    return rows, both_ends(actions, first, last)


def moved_contours(before: PlanDocument, after: PlanDocument) -> Flags:
    """Tell which contours are printed by another head, or much earlier or later, (n,)."""
    n = len(before.contours)
    places = [_places(document, n) for document in (before, after)]
    (head_was, place_was), (head_now, place_now) = places
    return np.asarray((head_was != head_now) | (np.abs(place_was - place_now) > MUCH))


def _places(document: PlanDocument, n: int) -> tuple[Ints, Floats]:
    """Return the head that prints each contour, and its place in the order of all, 0 to 1."""
    head, begin = np.zeros(n, np.int64), np.zeros(n)
    for index, actions in enumerate(document.plan.heads):
        printing = actions.kind == ActionKind.PRINT
        head[actions.contour[printing]] = index
        begin[actions.contour[printing]] = actions.begin_s[printing]
    place = np.empty(n)
    place[np.argsort(begin, kind="stable")] = np.arange(n) / max(n - 1, 1)
    return head, place


@dataclass(frozen=True, slots=True)
class Legs:
    """Straight parts of a head's travels that cross an outer wall of the layer of either end.

    Each end has the height of its end of the action: lifts are looked at from above.
    """

    action: Ints  # (k,) they belong to
    start: Floats  # (k, 3)
    goal: Floats  # (k, 3)


def legs_over(walls: Walls, actions: HeadActions) -> Legs:
    """Return what a head moves over outer walls without printing."""
    owner = np.repeat(np.arange(len(actions)), np.diff(actions.path_offsets))
    legs = np.flatnonzero((owner[1:] == owner[:-1]) & (actions.kind[owner[1:]] != ActionKind.PRINT))
    start, goal = actions.path[legs].copy(), actions.path[legs + 1].copy()
    start[:, 2] = actions.path[actions.path_offsets[owner[legs]], 2]
    goal[:, 2] = actions.path[actions.path_offsets[owner[legs] + 1] - 1, 2]
    over = over_walls(walls, start, goal)
    return Legs(owner[legs[over]], start[over], goal[over])


def crossed_walls(contours: Contours, legs: Sequence[Legs]) -> Flags:
    """Tell which contours are outer walls that any of the legs crosses, (n,)."""
    crossed = np.zeros(len(contours), np.bool_)
    start = np.concatenate([NO_POINTS, *(each.start for each in legs)])
    goal = np.concatenate([NO_POINTS, *(each.goal for each in legs)])
    outer = np.flatnonzero(np.isin(contours.role, OUTER) & (np.diff(contours.offsets) > 1))
    if not len(start) or not len(outer):
        return crossed
    cut = goal[:, :2] - start[:, :2]
    cut *= (END_MM / np.maximum(np.hypot(*cut.T), END_MM))[:, None]
    ways = np.stack([start[:, :2] + cut, goal[:, :2] - cut], axis=1)
    heights = np.concatenate([contours.start[outer, 2], start[:, 2], goal[:, 2]])
    level = np.unique(heights.round(6), return_inverse=True)[1].ravel()
    of_walls, *of_ends = np.split(level, [len(outer), len(outer) + len(start)])
    tree = shapely.STRtree(_lines(contours, outer, of_walls))
    for level in of_ends:
        strips = shapely.linestrings(ways + level[:, None, None] * STRIP)
        crossed[outer[tree.query(strips, predicate="intersects")[1]]] = True
    return crossed


def _lines(contours: Contours, rows: Ints, level: Ints) -> NDArray[np.object_]:
    """Return contours as lines in the strips of their levels, closed where they are loops."""
    sizes = np.diff(contours.offsets)[rows]
    owner = np.repeat(np.arange(len(rows)), sizes)
    shift = contours.offsets[rows] - (np.cumsum(sizes) - sizes)
    points = contours.points[np.arange(len(owner)) + np.repeat(shift, sizes)]
    loops = np.flatnonzero(contours.closed[rows])
    owner = np.concatenate([owner, loops])
    points = np.concatenate([points, contours.start[rows[loops]]])[:, :2]
    ranked = np.argsort(owner, kind="stable")
    moved = points[ranked] + level[owner[ranked], None] * STRIP
    return np.asarray(shapely.linestrings(moved, indices=owner[ranked]))
