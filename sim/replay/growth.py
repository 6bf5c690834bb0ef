"""The beads of a joint plan, and from which move of a head on each may be there.

At an action of the head every bead may be there that is not ordered after the action. So this
holds for every timing. Actions are legs (`sim.content.legs`).
"""

from __future__ import annotations

import numpy as np

from decmcts.print.contours import Contours
from decmcts.print.plan import ActionKind, HeadActions
from sim.arrays import Floats, Ints
from sim.content.legs import Legs
from sim.replay.shapes import Beads
from sim.rules.order import PartialOrder


def moves_of(actions: HeadActions, park: tuple[float, float, float]) -> tuple[Floats, Ints]:
    """Return the moves of a head, (m, 6), with the leg of each, (m,).

    A last move that goes nowhere stands for the rest after the last leg. A head that does
    nothing has that one only, at its park, of leg -1.
    """
    if not len(actions):
        return np.array([[*park, *park]], np.float64), np.array([-1])
    starts, owner = _segments(actions)
    ends = np.minimum(starts + 1, actions.path_offsets[owner + 1] - 1)
    moves = np.hstack([actions.path[starts], actions.path[ends]])
    last = np.concatenate([actions.path[-1], actions.path[-1]])
    return np.vstack([moves, last]), np.concatenate([owner, [len(actions) - 1]])


def _segments(actions: HeadActions) -> tuple[Ints, Ints]:
    """Return path index and leg of every segment; a path of one point has one segment."""
    sizes = np.diff(actions.path_offsets)
    count = np.maximum(sizes - 1, 1)
    owner = np.repeat(np.arange(len(actions)), count)
    within = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    return actions.path_offsets[owner] + within, owner


def first_moves(actions: HeadActions) -> Ints:
    """Return the first move of every leg, and behind them that of the last rest, (k + 1,)."""
    count = np.maximum(np.diff(actions.path_offsets) - 1, 1)
    return np.concatenate([[0], np.cumsum(count)]).astype(np.int64)


def beads_for(contours: Contours, legs: Legs, order: PartialOrder, head: int) -> Beads:
    """Return all beads of the plan, each with the first move of `head` that may meet it."""
    all_actions, last = legs.all_actions, legs.last(head)
    moves_begin = first_moves(all_actions[head])
    groups = []
    for other, actions in enumerate(all_actions):
        starts, owner = _segments(actions)
        printing = actions.kind[owner] == ActionKind.PRINT
        starts, owner = starts[printing], owner[printing]
        if other == head:
            since = _own_since(actions, starts, owner, last, moves_begin)
        else:
            # not ordered after leg u of this head  <=>  index below following(u)
            seen = np.searchsorted(order.following(head, other), owner, side="right")
            since = moves_begin[seen]
        ends = np.minimum(starts + 1, actions.path_offsets[owner + 1] - 1)
        groups.append((actions.path[starts], actions.path[ends], actions.contour[owner], since))
    start, end, label, since = (np.concatenate(column) for column in zip(*groups, strict=True))
    width, height = contours.width[label], contours.height[label]
    return Beads(start, end, width, height, since.astype(np.int64), label.astype(np.int64))


def _own_since(
    actions: HeadActions, starts: Ints, owner: Ints, last: Ints, moves_begin: Ints
) -> Ints:
    """Return from which move on a head may meet its own beads.

    Printed as sliced, a contour may slope over itself as its slicer meant it; in
    any other traversal each segment is material for those that follow. `last` is of
    each leg the last one of its action.
    """
    as_sliced = ~actions.reversed[owner] & (actions.entry[owner] == 0)
    move = moves_begin[owner] + (starts - actions.path_offsets[owner])
    return np.where(as_sliced, moves_begin[last[owner] + 1], move + 1)
