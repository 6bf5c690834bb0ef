"""What differs between two plans of one print, action by action."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.geometry.walls import Walls, over_walls
from decmcts.print.contours import Contours
from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from decmcts.print.walls import outer_walls

OTHER = np.uint8(1)  # a travel between places that the other plan has no travel between
OVER_WALL = np.uint8(2)  # a travel that crosses an outer wall
MOVED = np.uint8(4)  # a contour printed by another head, or much earlier or later in the order
MUCH = 0.01  # of the order, by which a contour has moved
PLACE_MM = 0.02  # by which ends of a travel may differ and be the same

Flags = tuple[NDArray[np.uint8], ...]


def flags_of(before: PlanDocument, after: PlanDocument) -> tuple[Flags, Flags]:
    """Return for each head of both plans the flags of its actions, (k,) each."""
    plans = [document.plan.heads for document in (before, after)]
    found = [[np.zeros(len(actions), np.uint8) for actions in plan] for plan in plans]
    walls = outer_walls(before.contours)
    keys = [[_travels(actions) for actions in plan] for plan in plans]
    for k in (0, 1):
        others = np.unique(np.concatenate([key for _, key in keys[1 - k]] or [np.zeros(0, "V")]))
        for flags, (rows, key), actions in zip(found[k], keys[k], plans[k], strict=True):
            flags[rows[~np.isin(key, others)]] |= OTHER
            flags[over_wall(walls, actions)] |= OVER_WALL
    moved = moved_contours(before, after)
    for plan, marks in zip(plans, found, strict=True):
        for actions, flags in zip(plan, marks, strict=True):
            printing = actions.kind == ActionKind.PRINT
            flags[printing] |= np.where(moved[actions.contour[printing]], MOVED, 0).astype(np.uint8)
    return tuple(found[0]), tuple(found[1])


def _travels(actions: HeadActions) -> tuple[NDArray[np.int64], NDArray[np.void]]:
    """Return the actions that travel, and a key of each: its two ends, whichever is first."""
    rows = np.flatnonzero((actions.kind == ActionKind.TRAVEL) | (actions.kind == ActionKind.PARK))
    first, last = actions.path_offsets[rows], actions.path_offsets[rows + 1] - 1
    ends = np.rint(np.stack([actions.path[first], actions.path[last]], axis=1) / PLACE_MM)
    ends = ends.astype(np.int64)
    swap = (ends[:, 0] > ends[:, 1])[:, 0]
    tied = (ends[:, 0] == ends[:, 1])[:, 0]
    swap |= tied & (ends[:, 0, 1] > ends[:, 1, 1])
    ends[swap] = ends[swap, ::-1]
    flat = np.ascontiguousarray(ends.reshape(len(rows), 6))
    return rows, flat.view([("", np.int64)] * 6).ravel().view(np.void(48).dtype)


def over_wall(walls: Walls, actions: HeadActions) -> NDArray[np.int64]:
    """Return the actions without extrusion that cross an outer wall of the layer of either end."""
    owner = np.repeat(np.arange(len(actions)), np.diff(actions.path_offsets))
    legs = np.flatnonzero((owner[1:] == owner[:-1]) & (actions.kind[owner[1:]] != ActionKind.PRINT))
    start, goal = actions.path[legs].copy(), actions.path[legs + 1].copy()
    start[:, 2] = actions.path[actions.path_offsets[owner[legs]], 2]
    goal[:, 2] = actions.path[actions.path_offsets[owner[legs] + 1] - 1, 2]
    return np.unique(owner[legs[over_walls(walls, start, goal)]])


def moved_contours(before: PlanDocument, after: PlanDocument) -> NDArray[np.bool_]:
    """Tell which contours are printed by another head, or much earlier or later, (n,)."""
    n = len(before.contours)
    places = [_places(document, n) for document in (before, after)]
    (head_was, place_was), (head_now, place_now) = places
    return np.asarray((head_was != head_now) | (np.abs(place_was - place_now) > MUCH))


def _places(document: PlanDocument, n: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the head that prints each contour, and its place in the order of all, 0 to 1."""
    head, begin = np.zeros(n, np.int64), np.zeros(n)
    for index, actions in enumerate(document.plan.heads):
        printing = actions.kind == ActionKind.PRINT
        head[actions.contour[printing]] = index
        begin[actions.contour[printing]] = actions.begin_s[printing]
    place = np.empty(n)
    place[np.argsort(begin, kind="stable")] = np.arange(n) / max(n - 1, 1)
    return head, place


def travel_by_layer(
    contours: Contours, plan: tuple[HeadActions, ...], layers: int
) -> NDArray[np.float64]:
    """Return the travel before the contours of each layer, mm, (layers,)."""
    found = np.zeros(layers)
    for actions in plan:
        mm, target = travels_to(actions)
        known = target >= 0
        found += np.bincount(contours.layer[target[known]], mm[known], layers)
    return found


def travels_to(actions: HeadActions) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the length of each travel, mm, and the contour printed next (-1: none)."""
    rows = np.flatnonzero(actions.kind != ActionKind.PRINT)
    steps = np.linalg.norm(np.diff(actions.path, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    mm = along[actions.path_offsets[rows + 1] - 1] - along[actions.path_offsets[rows]]
    printing = np.flatnonzero(actions.kind == ActionKind.PRINT)
    following = np.searchsorted(printing, rows)
    target = np.full(len(rows), -1, np.int64)
    there = following < len(printing)
    target[there] = actions.contour[printing[following[there]]]
    return mm, target
