"""Carries out given sequences of several heads as one joint order, on bare arrays.

Sequences with turns are one order of everything, placed as it stands. Without turns
the heads are merged: of those whose next contour may be printed, the one that is
there first goes first.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.compiled import inlined, kernel
from decmcts.team.engine.aside_kernels import path_from_parks, print_next, return_all, space_for
from decmcts.team.engine.joint_kernels import (
    NONE,
    Units,
    Visits,
    all_parked,
    has_capacity,
    new_units,
)
from decmcts.team.engine.spaces_kernels import Fleet, travel_seconds

OK, CONTRADICTED, SHUT_IN = 0, 1, 2


class Sequences(NamedTuple):
    """What each head prints, in order."""

    order: Int32s  # (n,) contours, head after head
    reversed: Flags  # (n,)
    offsets: Ints  # (heads + 1,)
    turns: Ints  # (n,) place of each in one order of all; (0,): none


@kernel
def with_capacity(units: Units, heads: int) -> Units:
    """Return units with rows free for all that one more contour can need."""
    used = units.used[0]
    if has_capacity(units, heads):
        return units
    larger = new_units(2 * len(units.head))
    larger.head[:used], larger.kind[:used] = units.head[:used], units.kind[:used]
    larger.contour[:used] = units.contour[:used]
    larger.reversed[:used] = units.reversed[:used]
    larger.target[:used], larger.space[:used] = units.target[:used], units.space[:used]
    larger.begin[:used], larger.end[:used] = units.begin[:used], units.end[:used]
    larger.before[:used] = units.before[:used]
    larger.used[0] = used
    return larger


@kernel
def units_for(n: int, heads: int) -> Units:
    """Return empty units with rows for n contours, to begin with."""
    return new_units(3 * n + 2 * heads * (heads + 2) + 16)


@kernel
def is_ready(c: int, placed: Flags, visits: Visits) -> bool:
    """Whether everything that supports contour c has been placed."""
    for k in range(visits.pred_offsets[c], visits.pred_offsets[c + 1]):
        if not placed[visits.preds[k]]:
            return False
    return True


@kernel
def carry_out(sequences: Sequences, visits: Visits, fleet: Fleet) -> tuple[Units, int]:
    """Place everything; returns the units and OK, CONTRADICTED (the precedence) or SHUT_IN."""
    heads, n = len(fleet.parks), len(sequences.order)
    units, state = units_for(n, heads), all_parked(len(visits.ends), fleet)
    placed = np.zeros(len(visits.ends), np.bool_)
    at = sequences.offsets[:-1].copy()
    by_turn = np.argsort(sequences.turns) if len(sequences.turns) else np.empty(0, np.int64)
    for i in range(n):
        if len(by_turn):
            row: int = by_turn[i]
            r = int(np.searchsorted(sequences.offsets, row, side="right")) - 1
        else:
            r = soonest(at, sequences, placed, visits, fleet, state.at, state.free)
            if r == NONE:
                return units, CONTRADICTED
            row = at[r]
            at[r] += 1
        c = sequences.order[row]
        if not is_ready(c, placed, visits):
            return units, CONTRADICTED
        units = with_capacity(units, heads)
        if not print_next(r, c, sequences.reversed[row], visits, fleet, units, state):
            return units, SHUT_IN
        placed[c] = True
    units = with_capacity(units, heads)
    return units, OK if return_all(visits, fleet, units, state) else SHUT_IN


@kernel
def soonest(
    at: Ints,
    sequences: Sequences,
    placed: Flags,
    visits: Visits,
    fleet: Fleet,
    where: Floats,
    free: Floats,
) -> int:
    """Of the heads whose next contour may be printed, the one that is there first; NONE: none."""
    best, found = np.inf, NONE
    for r in range(len(at)):
        if at[r] >= sequences.offsets[r + 1]:
            continue
        c = sequences.order[at[r]]
        side = 1 if sequences.reversed[at[r]] else 0
        there = free[r] + travel_seconds(where[r], visits.ends[c, side], fleet.travel[r])
        if there < best and is_ready(c, placed, visits):
            best, found = there, r
    return found


@inlined
def rail_axis(fleet: Fleet) -> int:
    """Axis of the one rail that all heads are on; NONE: there is none, or no other head."""
    if fleet.lined:
        for row in fleet.relation:
            for side in range(6):
                if np.isfinite(row[side]):
                    return side // 2
    return NONE


@inlined
def is_let_in(r: int, c: int, axis: int, known: Floats, visits: Visits, fleet: Fleet) -> bool:
    """`path_from_parks` on a rail, where most answers follow from earlier ones (mutates known).

    Heads before r must move aside for where its reserved space begins, those behind it for
    where it ends, and neither depends on the other. `known` has the least begin and the greatest
    end that were possible, and the greatest begin and the least end that were not.
    """
    space = space_for(r, c, False, fleet.parks, visits, fleet)
    begin, end = space[2 * axis], space[2 * axis + 1]
    if begin <= known[2] or end >= known[3]:
        return False
    if begin >= known[0] and end <= known[1]:
        return True
    if path_from_parks(r, c, visits, fleet):
        known[0], known[1] = min(known[0], begin), max(known[1], end)
        return True
    if begin >= known[0]:
        known[3] = end
    elif end <= known[1]:
        known[2] = begin
    return False


@kernel
def eligible_heads(reached: Flags, visits: Visits, fleet: Fleet) -> Flags:
    """Of the heads that reach each contour, those the others can move aside for, (n, heads)."""
    from_parks, axis = reached.copy(), rail_axis(fleet)
    for r in range(reached.shape[1]):
        known = np.array([np.inf, -np.inf, -np.inf, np.inf])
        for c in range(reached.shape[0]):
            if reached[c, r] and axis == NONE:
                from_parks[c, r] = path_from_parks(r, c, visits, fleet)
            elif reached[c, r]:
                from_parks[c, r] = is_let_in(r, c, axis, known, visits, fleet)
    return from_parks
