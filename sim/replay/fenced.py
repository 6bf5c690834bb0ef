"""Heads that print no more and stand in the way: nothing may touch them, nor be printed into them.

What moves is looked at as boxes around whole moves, which is more careful than exact.

Which beads may be there, for every timing: at an action of the head every bead may be there that is
not ordered after the action. So this holds for every timing. Actions are legs
(`sim.content.paths`).
"""

from __future__ import annotations

from itertools import product

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.print.contours import Contours
from decmcts.print.machine import Head, Machine, Point, line_of
from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from sim.content.paths import Legs
from sim.faults import LIMIT, Fault, FaultKind, listed
from sim.replay.bodies import segments
from sim.replay.material import find_contacts
from sim.replay.shapes import (
    Beads,
    as_material,
    beads_there,
    bounds_of,
    parts_of,
    separations_between,
)
from sim.rules.order import PartialOrder

TOLERANCE_MM = 1e-4


def check_fenced(document: PlanDocument) -> list[Fault]:
    """Check that no head of a plan comes near heads that are fenced, nor prints into them."""
    if document.fenced is None:
        return []
    whole, at = document.fenced.machine, document.fenced.at
    given = {actions.head: actions for actions in document.plan.heads}
    met, within = list[str](), list[str]()
    for gone in (head for head in whole.heads if head.name in at):
        line = line_of(at[gone.name])
        pieces = segments(line).reshape(-1, 6)
        for mine in document.machine.heads:
            moves = moves_of(given.get(mine.name), mine.park)[0]
            bad = np.flatnonzero(too_near(whole, mine, moves, gone, pieces))
            met += [
                f"head {mine.name} comes too near to head {gone.name}, which {_place(line)}, "
                f"between ({', '.join(f'{v:.2f}' for v in moves[k, :3])}) and "
                f"({', '.join(f'{v:.2f}' for v in moves[k, 3:])})"
                for k in bad[:LIMIT].tolist()
            ]
        within += [
            f"contour {contour} is printed into head {gone.name}, which {_place(line)}"
            for contour in _printed_into(document, gone, pieces)
        ]
    return [*listed(FaultKind.HEAD_HEAD, met), *listed(FaultKind.HEAD_MATERIAL, within)]


def _place(line: Floats) -> str:
    """Say where a head stands, or from where to where it may."""
    ends = [f"({x:.2f}, {y:.2f}, {z:.2f})" for x, y, z in (line[0], line[-1])]
    return f"stands at {ends[0]}" if len(set(ends)) == 1 else "may stand from " + " to ".join(ends)


def too_near(machine: Machine, mine: Head, moves: Floats, other: Head, its: Floats) -> Flags:
    """Tell in which moves a head may come too near to another in any of its moves, (m,).

    Both are looked at as boxes around whole moves: any two opposite corners of such a box, rows
    of `moves` (m, 6) and `its` (n, 6), stand for it.
    """
    low, high = _corners(moves)
    its_low, its_high = _corners(its)
    bad = np.zeros(len(moves), np.bool_)
    margin = machine.head_clearance_mm - TOLERANCE_MM
    boxes = ([bounds_of(part.vertices()) for part in parts_of(head)] for head in (mine, other))
    for ours, theirs in product(*boxes):
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


def _printed_into(document: PlanDocument, gone: Head, pieces: Floats) -> list[int]:
    """Return contours of a plan that go into a head somewhere on the pieces of a line."""
    if not any(ActionKind.PRINT in actions.kind for actions in document.plan.heads):
        return []
    beads = as_material(beads_there(document.contours), document.machine, TOLERANCE_MM)
    contacts = find_contacts(
        pieces, beads, gone, clearance_mm=document.machine.clearance_mm,
        tolerance_mm=TOLERANCE_MM, limit=LIMIT,
    )  # fmt: skip
    return [int(beads.label[contact.bead]) for contact in contacts]


def moves_of(actions: HeadActions | None, park: Point) -> tuple[Floats, Ints]:
    """Return the moves of a head, (m, 6), with the leg of each, (m,).

    A last move that goes nowhere stands for the rest after the last leg. A head that does
    nothing has that one only, at its park, of leg -1.
    """
    if not actions:
        return np.array([[*park, *park]], np.float64), np.array([-1])
    starts, ends, owner = _segments(actions)
    moves = np.hstack([actions.path[starts], actions.path[ends]])
    last = np.concatenate([actions.path[-1], actions.path[-1]])
    return np.vstack([moves, last]), np.concatenate([owner, [len(actions) - 1]])


def _segments(actions: HeadActions) -> tuple[Ints, Ints, Ints]:
    """Return both ends in the path and leg of every segment; a path of one point has one."""
    sizes = np.diff(actions.path_offsets)
    count = np.maximum(sizes - 1, 1)
    owner = np.repeat(np.arange(len(actions)), count)
    within = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    starts = actions.path_offsets[owner] + within
    return starts, np.minimum(starts + 1, actions.path_offsets[owner + 1] - 1), owner


def beads_for(contours: Contours, legs: Legs, order: PartialOrder, head: int) -> Beads:
    """Return all beads of the plan, each with the first move of `head` that may meet it."""
    all_actions, last = legs.all_actions, legs.last(head)
    count = np.maximum(np.diff(all_actions[head].path_offsets) - 1, 1)
    moves_begin = np.concatenate([[0], np.cumsum(count)])  # of each leg, and the last rest
    groups = []
    for other, actions in enumerate(all_actions):
        starts, ends, owner = _segments(actions)
        printing = actions.kind[owner] == ActionKind.PRINT
        starts, ends, owner = starts[printing], ends[printing], owner[printing]
        if other == head:
            since = _own_since(actions, starts, owner, last, moves_begin)
        else:
            # not ordered after leg u of this head  <=>  index below following(u)
            seen = np.searchsorted(order.following(head, other), owner, side="right")
            since = moves_begin[seen]
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
