"""Heads that print no more and stand in the way: nothing may touch them, nor be printed into them.

What moves is looked at as boxes around whole moves, which is more careful than exact.

Which beads may be there, for every timing: at an action of the head every bead may be there that is
not ordered after the action. So this holds for every timing. Actions are legs
(`sim.content.paths`).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from decmcts.print.contours import Contours
from decmcts.print.machine import Head, Machine, Stands, line_of
from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from sim.arrays import Flags, Floats, Ints
from sim.content.paths import Legs
from sim.faults import LIMIT, Fault, FaultKind, listed
from sim.replay.material import find_contacts
from sim.replay.shapes import Beads, as_material, beads_there, parts_of, separations_between
from sim.rules.order import PartialOrder

TOLERANCE_MM = 1e-4


def check_fenced(document: PlanDocument) -> list[Fault]:
    """Check that no head of a plan comes near heads that are fenced, nor prints into them."""
    if document.fenced is None:
        return []
    whole, at = document.fenced.machine, document.fenced.at
    gone = {head.name: head for head in whole.heads if head.name in at}
    given = {actions.head: actions for actions in document.plan.heads}
    met: list[str] = []
    within: list[str] = []
    for name, head in gone.items():
        line = _pieces(at[name])
        for mine in document.machine.heads:
            moves = _moves(mine, given.get(mine.name))
            met += head_meets(whole, mine, moves, head, line)
        within += _printed_into(document, head, line)
    return [*listed(FaultKind.HEAD_HEAD, met), *listed(FaultKind.HEAD_MATERIAL, within)]


def _moves(head: Head, actions: HeadActions | None) -> Floats:
    if actions is None or not len(actions):
        return np.array([[*head.park, *head.park]], np.float64)
    return moves_of(actions, head.park)[0]


def _pieces(stands: Stands) -> Floats:
    line = line_of(stands)
    return np.hstack([line[:-1], line[1:]] if len(line) > 1 else [line, line])


def _place(line: Floats) -> str:
    """Say where a head stands, or from where to where it may."""
    ends = [f"({x:.2f}, {y:.2f}, {z:.2f})" for x, y, z in (line[0, :3], line[-1, 3:])]
    return f"stands at {ends[0]}" if len(set(ends)) == 1 else "may stand from " + " to ".join(ends)


def head_meets(machine: Machine, mine: Head, moves: Floats, gone: Head, line: Floats) -> list[str]:
    """Say in which moves a head comes nearer to a fenced one than it may; `line` has its pieces."""
    bad = too_near(machine, mine, moves, gone, line)
    return [
        f"head {mine.name} comes too near to head {gone.name}, which {_place(line)}, between "
        f"({', '.join(f'{v:.2f}' for v in moves[k, :3])}) and "
        f"({', '.join(f'{v:.2f}' for v in moves[k, 3:])})"
        for k in np.flatnonzero(bad)[:LIMIT].tolist()
    ]


def too_near(machine: Machine, mine: Head, moves: Floats, other: Head, its: Floats) -> Flags:
    """Tell in which moves a head may come too near to another in any of its moves, (m,).

    Both are looked at as boxes around whole moves: any two opposite corners of such a box, rows
    of `moves` (m, 6) and `its` (n, 6), stand for it.
    """
    low, high = _corners(moves)
    its_low, its_high = _corners(its)
    bad = np.zeros(len(moves), np.bool_)
    margin = machine.head_clearance_mm - TOLERANCE_MM
    for ours, theirs in product(_boxes(mine), _boxes(other)):
        at_low, at_high = its_low + theirs[0] - margin, its_high + theirs[1] + margin
        near = (low + ours[0] < at_high.max(axis=0)) & (high + ours[1] > at_low.min(axis=0))
        for k in np.flatnonzero(near.all(axis=1) & ~bad).tolist():
            meets = (low[k] + ours[0] < at_high) & (high[k] + ours[1] > at_low)
            bad[k] = bool(meets.all(axis=1).any())
    for axis, side, least in separations_between(machine, other, mine):
        gap = low - its_high.max(axis=0) if side > 0.0 else its_low.min(axis=0) - high
        bad |= gap[:, axis] < least - TOLERANCE_MM
    return bad


def _corners(moves: Floats) -> tuple[Floats, Floats]:
    """Return least and most of each move, (m, 3) both."""
    ends = moves[:, :3], moves[:, 3:]
    return np.minimum(*ends), np.maximum(*ends)


def _boxes(head: Head) -> list[Floats]:
    """Return least and most of each part of a head round its tip, slices too, (2, 3) each."""
    return [
        np.array([[*part.polygon.min(axis=0), part.low], [*part.polygon.max(axis=0), part.high]])
        for part in parts_of(head)
    ]


def _printed_into(document: PlanDocument, gone: Head, line: Floats) -> Sequence[str]:
    if not any(ActionKind.PRINT in actions.kind for actions in document.plan.heads):
        return []
    beads = as_material(beads_there(document.contours), document.machine, TOLERANCE_MM)
    contacts = find_contacts(
        line, beads, gone, clearance_mm=document.machine.clearance_mm,
        tolerance_mm=TOLERANCE_MM, limit=LIMIT,
    )  # fmt: skip
    return [
        f"contour {beads.label[c.bead]} is printed into head {gone.name}, which {_place(line)}"
        for c in contacts
    ]


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
