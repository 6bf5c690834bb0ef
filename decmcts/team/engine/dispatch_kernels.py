"""List scheduling for several heads: who prints what next, on bare arrays.

The head that is free first takes, of the contours it can begin at once, the one of
least score. Where there is none it sleeps until it may begin one. Contours are grouped
in columns, those of one part and one place along the machine. Of each column only the
first contour left is a candidate, if all that supports it was placed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.compiled import inlined, kernel
from decmcts.team.engine.aside_kernels import print_next, return_all
from decmcts.team.engine.carry_out_kernels import OK, SHUT_IN, units_for, with_capacity
from decmcts.team.engine.joint_kernels import (
    NONE,
    TeamState,
    Units,
    Visits,
    all_parked,
    clear_from,
    end_of,
    ready_at,
)
from decmcts.team.engine.spaces_kernels import (
    Fleet,
    Point,
    space_at,
    space_of_travel,
    travel_seconds,
)

LATER = 1e-9  # seconds; what is nearer is now
OPEN, NEWLY_READY = 0, 1  # of `Pool.counts`
URGENCY, BOTTLENECK, OTHERS = 3, 4, 5  # columns of `POLICIES` that make the key
PATIENCE = 0.003  # share of its printing time that a contour may be waited for


class KeyTerms(NamedTuple):
    """What `write_keys` makes a policy's keys of; see `decmcts.team.engine.problem`."""

    progress: Floats  # (n,) share of its part's work before it
    urgency: Floats  # (n,) 0: the longest chain comes after it, 1: nothing does
    side: Ints  # (n,) head in whose share of the machine it lies
    bottleneck: Flags  # (n,) it lies there


class Policy(NamedTuple):
    """What guides the choice."""

    key: Floats  # (heads, n) least first
    place: Floats  # (heads, n) where in the head's sweep, 0..1
    eligible: Flags  # (n, heads)
    weights: Floats  # (heads, 3) of the key, of waste, of being out of step
    column_offsets: Ints  # (columns + 1,)
    column: Int32s  # (n,) contours, column after column, each in source order
    succ_offsets: Ints
    succs: Int32s


class Pool(NamedTuple):
    """What is left to do; written as contours are placed."""

    first: Ints  # (columns,) row of `column` that may still be to do
    missing: Int32s  # (n,) what supports it and was not placed
    ready: Floats  # (n,) when it may begin, once nothing is missing
    placed: Flags  # (n,)
    column_of: Int32s  # (n,)
    open: Ints  # (columns,) those whose first may be ready, in no order
    is_open: Flags  # (columns,) whether among these
    newly_ready: Ints  # (columns,) contours that the last one placed made ready
    counts: Ints  # (2,) how many `open` and `newly_ready` there are
    decides_at: Floats  # (heads,) each head decides no sooner, even if it is free
    last_contour: Ints  # (heads,) contour it printed last; NONE
    earliest: Floats  # (heads, columns) a head begins the first left no sooner
    earliest_row: Ints  # (heads, columns) row of `column` that `earliest` is for
    earliest_unit: Ints  # (heads,) the head's last unit when `earliest` was written


@kernel
def write_keys(r: int, row: Floats, contours: Ints, terms: KeyTerms, keys: Floats) -> None:
    """Write when head r wants to print contours by a row of `POLICIES`, in progress of a part.

    What lies in the others' share of the machine comes later, the bottleneck sooner.
    """
    for c in contours:
        key = terms.progress[c] + row[URGENCY] * (terms.urgency[c] - terms.progress[c])
        if terms.side[c] != r:
            key += row[OTHERS]
        if terms.bottleneck[c]:
            key -= row[BOTTLENECK]
        keys[r, c] = key


@kernel
def new_pool(visits: Visits, policy: Policy, heads: int) -> Pool:
    """Nothing placed yet."""
    n, columns = len(visits.ends), len(policy.column_offsets) - 1
    missing = np.empty(n, np.int32)
    for c in range(n):
        missing[c] = visits.pred_offsets[c + 1] - visits.pred_offsets[c]
    column_of = np.empty(n, np.int32)
    for column in range(columns):
        for row in range(policy.column_offsets[column], policy.column_offsets[column + 1]):
            column_of[policy.column[row]] = column
    counts = np.zeros(2, np.int64)
    counts[OPEN] = columns
    return Pool(
        policy.column_offsets[:-1].copy(),
        missing,
        np.zeros(n),
        np.zeros(n, np.bool_),
        column_of,
        np.arange(columns),
        np.ones(columns, np.bool_),
        np.empty(columns, np.int64),
        counts,
        np.zeros(heads),
        np.full(heads, NONE),
        np.zeros((heads, columns)),
        np.full((heads, columns), NONE),
        np.full(heads, NONE),
    )


@inlined
def next_head(heads: TeamState, pool: Pool) -> tuple[int, float]:
    """Return the head that decides next, and when."""
    first, start = 0, np.inf
    for r in range(len(pool.decides_at)):
        at = max(heads.free[r], pool.decides_at[r])
        if at < start:
            first, start = r, at
    return first, start


@inlined
def next_decision(r: int, start: float, heads: TeamState, pool: Pool) -> float:
    """When another head than r decides next, after `start`; infinite: none does."""
    until = np.inf
    for s in range(len(heads.free)):
        decides = max(heads.free[s], pool.decides_at[s])
        if s != r and decides > start + LATER:
            until = min(until, decides)
    return until


@inlined
def out_of_step(
    r: int, u: int, start: float, place: Floats, free: Floats, last_contour: Ints,
) -> float:  # fmt: skip
    """How far u is from where head r's sweep should be beside the others' contours."""
    off = 0.0
    for s in range(len(last_contour)):
        if s != r and last_contour[s] != NONE and free[s] > start:
            off += abs(place[r, u] - place[s, last_contour[s]])
    return off


@inlined
def nearer_end(at: Point, u: int, visits: Visits, travel: Floats) -> tuple[float, bool]:
    """Seconds to the end of a contour that is reached sooner, and whether it is its last."""
    there = travel_seconds(at, end_of(u, 0, visits), travel)
    if visits.reversible[u]:
        back = travel_seconds(at, end_of(u, 1, visits), travel)
        if back < there:
            return back, True
    return there, False


@inlined
def first_of(column: int, policy: Policy, pool: Pool) -> int:
    """First contour of a column not yet placed; NONE: all were (mutates pool)."""
    end = policy.column_offsets[column + 1]
    while pool.first[column] < end and pool.placed[policy.column[pool.first[column]]]:
        pool.first[column] += 1
    return policy.column[pool.first[column]] if pool.first[column] < end else NONE


@inlined
def space_free_from(
    r: int, u: int, back: bool, at: Point, start: float, visits: Visits, fleet: Fleet,
    units: Units, heads: TeamState,
) -> float:  # fmt: skip
    """When head r may reserve contour u's space and the path there, from `start` on.

    By the units placed so far; units placed later can only make it later.
    """
    side = 1 if back else 0
    path = space_of_travel(at, end_of(u, side, visits), fleet.ceiling)
    held = space_at(visits.pieces.space, visits.pieces.offsets[2 * u + side])
    clear = clear_from(r, path, start, visits, fleet, units, heads)
    both: float = clear_from(r, held, clear, visits, fleet, units, heads)
    return both


@inlined
def first_open(i: int, policy: Policy, pool: Pool) -> int:
    """First contour left of the i-th open column; NONE: it is open no more (mutates pool)."""
    column = pool.open[i]
    u = first_of(column, policy, pool)
    if u != NONE and pool.missing[u] == 0:
        return u
    pool.counts[OPEN] -= 1
    pool.open[i], pool.is_open[column] = pool.open[pool.counts[OPEN]], False
    return NONE


@inlined
def choose(
    r: int, start: float, visits: Visits, fleet: Fleet, policy: Policy, units: Units,
    heads: TeamState, pool: Pool,
) -> tuple[int, bool, float]:  # fmt: skip
    """Return the contour head r should print next, and whether reversed; NONE: wait until when.

    A contour that can not begin before some time (`Pool.earliest`) is passed over until then,
    unless this head moves.
    """
    at = (heads.at[r, 0], heads.at[r, 1], heads.at[r, 2])
    if pool.earliest_unit[r] != heads.last[r]:  # begins were found for where it stood before
        pool.earliest_row[r], pool.earliest_unit[r] = NONE, heads.last[r]
    best, chosen, is_reversed, wakes = np.inf, NONE, False, np.inf
    key_weight, waste_weight = policy.weights[r, 0], policy.weights[r, 1]
    step_weight = policy.weights[r, 2]
    i = 0
    while i < pool.counts[OPEN]:
        column = pool.open[i]
        u = first_open(i, policy, pool)
        if u == NONE:
            continue
        i += 1
        if not policy.eligible[u, r]:
            continue
        row = pool.first[column]
        if pool.earliest_row[r, column] == row and start + LATER < pool.earliest[r, column]:
            wakes = min(wakes, pool.earliest[r, column])
            continue
        score = key_weight * policy.key[r, u]
        if score > best:
            continue
        if step_weight > 0.0:
            off = out_of_step(r, u, start, policy.place, heads.free, pool.last_contour)
            score += step_weight * off
        there, back = nearer_end(at, u, visits, fleet.travel[r])
        lost, seconds = max(there, pool.ready[u] - start), visits.seconds[r, u]
        score += waste_weight * lost / (seconds + lost + LATER)
        if score > best or (score == best and chosen != NONE and u > chosen):
            continue
        earliest = max(start, pool.ready[u] - there - PATIENCE * seconds)
        if earliest <= start + LATER:
            earliest = space_free_from(r, u, back, at, start, visits, fleet, units, heads)
        if earliest > start + LATER:
            pool.earliest[r, column], pool.earliest_row[r, column] = earliest, row
            wakes = min(wakes, earliest)
        else:
            best, chosen, is_reversed = score, u, back
            # the best so far goes to the front: a good score early rules others out by key alone
            pool.open[i - 1], pool.open[0] = pool.open[0], pool.open[i - 1]
    return chosen, is_reversed, wakes if wakes < np.inf else next_decision(r, start, heads, pool)


@inlined
def open_first(column: int, policy: Policy, pool: Pool) -> None:
    """Note that the first contour left of a column has become ready, if it has (mutates pool)."""
    u = first_of(column, policy, pool)
    if u == NONE or pool.missing[u] > 0:
        return
    if not pool.is_open[column]:
        pool.open[pool.counts[OPEN]], pool.is_open[column] = column, True
        pool.counts[OPEN] += 1
    for k in range(pool.counts[NEWLY_READY]):
        if pool.newly_ready[k] == u:
            return
    pool.newly_ready[pool.counts[NEWLY_READY]] = u
    pool.counts[NEWLY_READY] += 1


@inlined
def take(r: int, c: int, visits: Visits, policy: Policy, heads: TeamState, pool: Pool) -> None:
    """Note that head r prints c (mutates pool)."""
    pool.placed[c], pool.last_contour[r] = True, c
    pool.counts[NEWLY_READY] = 0
    for k in range(policy.succ_offsets[c], policy.succ_offsets[c + 1]):
        s = policy.succs[k]
        pool.missing[s] -= 1
        if pool.missing[s] == 0:
            pool.ready[s] = ready_at(s, visits, heads)
            open_first(pool.column_of[s], policy, pool)
    open_first(pool.column_of[c], policy, pool)


@inlined
def wake(
    r: int, start: float, visits: Visits, fleet: Fleet, policy: Policy, heads: TeamState, pool: Pool
) -> None:
    """Let sleeping heads decide sooner, where head r made contours ready (mutates pool)."""
    for s in range(len(heads.free)):
        if s == r or pool.decides_at[s] <= start:
            continue
        if heads.last[s] != pool.earliest_unit[s]:  # it had to step aside
            pool.decides_at[s] = start
            continue
        at = (heads.at[s, 0], heads.at[s, 1], heads.at[s, 2])
        for k in range(pool.counts[NEWLY_READY]):
            u = pool.newly_ready[k]
            if policy.eligible[u, s]:
                there, _ = nearer_end(at, u, visits, fleet.travel[s])
                soonest = pool.ready[u] - there - PATIENCE * visits.seconds[s, u]
                pool.decides_at[s] = min(pool.decides_at[s], max(start, soonest))


@inlined
def next_print(
    visits: Visits, fleet: Fleet, policy: Policy, units: Units, heads: TeamState, pool: Pool
) -> tuple[int, int, bool, float]:  # fmt: skip
    """Return which head prints next, what, whether reversed, and when it decides.

    NONE as the contour: no head finds any, now or later. Mutates pool: heads that find none
    now sleep.
    """
    while True:
        r, start = next_head(heads, pool)
        c, back, until = choose(r, start, visits, fleet, policy, units, heads, pool)
        if c != NONE or until == np.inf:
            return r, c, back, start
        pool.decides_at[r] = until


@kernel
def dispatch(visits: Visits, fleet: Fleet, policy: Policy) -> tuple[Units, int]:
    """Print everything; returns the units in the order they were placed and OK or SHUT_IN."""
    heads, n = len(fleet.parks), len(visits.ends)
    units, state = units_for(n, heads), all_parked(n, fleet)
    pool = new_pool(visits, policy, heads)
    left, lowest = n, 0
    while left > 0:
        r, c, back, start = next_print(visits, fleet, policy, units, state, pool)
        if c == NONE:
            while pool.placed[lowest]:  # all that supports the lowest one left was placed
                lowest += 1
            c = lowest
            while not policy.eligible[c, r]:
                r = (r + 1) % heads
        units = with_capacity(units, heads)
        if not print_next(r, c, back, visits, fleet, units, state):
            return units, SHUT_IN
        take(r, c, visits, policy, state, pool)
        wake(r, start, visits, fleet, policy, state, pool)
        left -= 1
    units = with_capacity(units, heads)
    return units, OK if return_all(visits, fleet, units, state) else SHUT_IN
