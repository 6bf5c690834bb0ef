"""What differs between two plans of one print, action by action, and where they cross walls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from decmcts.print.contours import Contours
from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from sim.arrays import Flags, Floats, Ints
from sim.content.over_walls import crossed_by
from sim.pictures.layer_travels import both_ends, in_no_place_of

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
    moved = moved_contours(before, after)
    ends = [[_travels(actions) for actions in plan] for plan in plans]
    for k in (0, 1):
        others = np.concatenate([NOWHERE, *(there for _, there in ends[1 - k])])
        for flags, (rows, mine) in zip(found[k], ends[k], strict=True):
            flags[rows[in_no_place_of(mine, others)]] |= OTHER
        over, walls = over_walls(before.contours, plans[k])
        of_contours = moved * MOVED
        of_contours[walls] |= CROSSED
        for flags, rows, actions in zip(found[k], over, plans[k], strict=True):
            flags[rows] |= OVER_WALL
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


def over_walls(contours: Contours, heads: Sequence[HeadActions]) -> tuple[list[Ints], Ints]:
    """Return of each head the actions that cross outer walls without printing, and those walls.

    Walls of the layers of both ends of an action count: lifts are looked at from above.
    """
    legs = [_legs(actions) for actions in heads]
    head = np.repeat(np.arange(len(heads)), [len(action) for action, *_ in legs])
    action, *ends = (np.concatenate(column) for column in zip(*legs, strict=True))
    leg, wall = crossed_by(contours, *ends)
    return [action[leg[head[leg] == h]] for h in range(len(heads))], wall


def _legs(actions: HeadActions) -> tuple[Ints, Floats, Floats, Floats, Floats]:
    """Return straight parts of travels: action, both ends from above, heights of its ends."""
    owner = np.repeat(np.arange(len(actions)), np.diff(actions.path_offsets))
    legs = np.flatnonzero((owner[1:] == owner[:-1]) & (actions.kind[owner[1:]] != ActionKind.PRINT))
    flat, z, action = actions.path[:, :2], actions.path[:, 2], owner[legs]
    begins, ends = actions.path_offsets[action], actions.path_offsets[action + 1] - 1
    return action, flat[legs], flat[legs + 1], z[begins], z[ends]
