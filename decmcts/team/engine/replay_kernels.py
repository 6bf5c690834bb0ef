"""One order of everything that several heads do, carried out again from any turn on.

What is known before each turn is marked, so that a change in the middle costs what it
touches rather than the whole print (`decmcts.team.engine.carry_out_kernels` begins at the first).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.compiled import apart, inlined, kernel
from decmcts.team.engine.aside_kernels import print_next, return_all
from decmcts.team.engine.joint_kernels import NONE, TeamState, Units, Visits, has_capacity
from decmcts.team.engine.spaces_kernels import Fleet, travel_seconds


class JointOrder(NamedTuple):
    """Who prints what, in one order of all; changed in place."""

    order: Ints  # (n,) contours
    turn: Ints  # (n,) place of each contour in it
    head: Ints  # (n,) of each contour
    reversed: Flags  # (n,)
    before: Ints  # (n,) what its head prints before each contour; NONE
    behind: Ints  # (n,) and after it


class Marks(NamedTuple):
    """What `TeamState` and `Units` held before each turn."""

    used: Ints  # (n + 1,)
    last: Ints  # (n + 1, heads)
    free: Floats  # (n + 1, heads)
    at: Floats  # (n + 1, heads, 3)
    rest: Floats  # (n + 1, heads, 6)
    known: Ints  # (1,) turns up to which all this is true
    waited: Ints  # (n + 1, heads, heads)
    tail: Floats  # (n + 1, heads) see `decmcts.team.dec_mcts.windows_kernels`


@inlined
def mark(turn: int, units: Units, heads: TeamState, marks: Marks) -> None:
    """Note what holds before a turn (mutates marks)."""
    marks.used[turn] = units.used[0]
    for r in range(len(heads.free)):
        marks.last[turn, r], marks.free[turn, r] = heads.last[r], heads.free[r]
        for axis in range(3):
            marks.at[turn, r, axis] = heads.at[r, axis]
        for side in range(6):
            marks.rest[turn, r, side] = heads.rest[r, side]
        for s in range(len(heads.free)):
            marks.waited[turn, r, s] = heads.waited[r, s]


@inlined
def restore(turn: int, units: Units, heads: TeamState, marks: Marks) -> None:
    """Go back to what held before a turn (mutates units, heads)."""
    units.used[0] = marks.used[turn]
    for r in range(len(heads.free)):
        heads.last[r], heads.free[r] = marks.last[turn, r], marks.free[turn, r]
        for axis in range(3):
            heads.at[r, axis] = marks.at[turn, r, axis]
        for side in range(6):
            heads.rest[r, side] = marks.rest[turn, r, side]
        for s in range(len(heads.free)):
            heads.waited[r, s] = marks.waited[turn, r, s]


@inlined
def later_by(turn: int, fleet: Fleet, heads: TeamState, marks: Marks) -> float:
    """How much later the print ends than by the marks, judged by the tails at a turn."""
    latest, usual, last = -np.inf, -np.inf, len(marks.used) - 1
    for r in range(len(heads.free)):
        tail = marks.tail[turn, r]
        usual = max(usual, marks.free[turn, r] + tail)
        if turn == last:
            tail = travel_seconds(heads.at[r], fleet.parks[r], fleet.travel[r])
        latest = max(latest, heads.free[r] + tail)
    return latest - usual


@apart
def place_turns(
    contours: Ints, begin: int, end: int, marks_to: int, top: int, most: float, joint: JointOrder,
    visits: Visits, fleet: Fleet, units: Units, heads: TeamState, marks: Marks,
) -> float:  # fmt: skip
    """Print `contours`, by turn, at turns begin..end - 1 (mutates units, heads, marks).

    Turns up to `marks_to` are marked. Returns by how much later than by the marks the print
    then ends, judged from turn `top` on; infinite if heads shut each other in, if `units` is
    full, or as soon as it is more than `most`. Callers share this one compiled copy of the
    engine, which else takes minutes to compile.
    """
    later = 0.0
    for turn in range(begin, end):
        c = contours[turn]
        if not has_capacity(units, len(heads.free)) or not print_next(
            joint.head[c], c, joint.reversed[c], visits, fleet, units, heads
        ):
            return np.inf
        if turn < marks_to:
            mark(turn + 1, units, heads, marks)
            marks.known[0] = turn + 1
        if turn + 1 >= top:
            later = later_by(turn + 1, fleet, heads, marks)
            if later > most:
                return np.inf
    return later


@inlined
def replay(
    end: int, joint: JointOrder, visits: Visits, fleet: Fleet, units: Units, heads: TeamState,
    marks: Marks,
) -> bool:  # fmt: skip
    """Mark all turns up to `end` (mutates units, heads, marks); False: they cannot be printed."""
    begin, n = marks.known[0], len(joint.order)
    if begin >= end:
        return True
    restore(begin, units, heads, marks)
    later = place_turns(
        joint.order, begin, end, end, n + 1, np.inf, joint, visits, fleet, units, heads,
        marks,
    )  # fmt: skip
    return later < np.inf


@kernel
def finish(
    begin: int, joint: JointOrder, visits: Visits, fleet: Fleet, units: Units, heads: TeamState,
    marks: Marks,
) -> float:  # fmt: skip
    """Return when all heads are at their parks (mutates units, heads, marks).

    Infinite if the order cannot be carried out. All turns up to `begin` are marked, or
    already were; those behind it are not.
    """
    n = len(joint.order)
    if not replay(begin, joint, visits, fleet, units, heads, marks):
        return np.inf
    restore(begin, units, heads, marks)
    marks.known[0] = begin
    later = place_turns(
        joint.order, begin, n, begin, n + 1, np.inf, joint, visits, fleet, units, heads,
        marks,
    )  # fmt: skip
    if later == np.inf or not has_capacity(units, len(heads.free)):
        return np.inf
    if not return_all(visits, fleet, units, heads):
        return np.inf
    latest: float = heads.free.max()
    return latest


@kernel
def link(joint: JointOrder, heads: int) -> None:
    """Find each contour's turn, and what its head prints before and after it (mutates joint)."""
    last = np.full(heads, NONE)
    for turn in range(len(joint.order)):
        c = joint.order[turn]
        r = joint.head[c]
        joint.turn[c], joint.before[c], joint.behind[c] = turn, last[r], NONE
        if last[r] != NONE:
            joint.behind[last[r]] = c
        last[r] = c
