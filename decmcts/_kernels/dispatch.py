"""List scheduling for several heads: who prints what next, on bare arrays.

The head that is free first takes, of the contours it can begin at once, the one of
least score; where there is none it waits until another head gives room back. Contours
are looked at by column (those of one part and one place along the machine): of each
only the first that is left.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.aside import print_next, return_all
from decmcts._kernels.carry_out import OK, SHUT_IN, room_enough, units_for
from decmcts._kernels.jit import inlined, kernel
from decmcts._kernels.joint import NONE, Heads, Units, Visits, all_parked, end_of, rests_on
from decmcts._kernels.rooms import (
    Fleet,
    Point,
    Room,
    keep_room,
    room_at,
    room_of_travel,
    too_near,
    travel_seconds,
)

LATER = 1e-9  # seconds; what is nearer is now
SURE = 1e-6  # seconds; a head that sleeps is looked at again so much sooner than it need be
PATIENCE = 0.003  # share of its printing time that a contour may be waited for


class Policy(NamedTuple):
    """What guides the choice."""

    key: NDArray[np.float64]  # (heads, n) least first
    place: NDArray[np.float64]  # (heads, n) where in the head's sweep, 0..1
    eligible: NDArray[np.bool_]  # (n, heads)
    weights: NDArray[np.float64]  # (heads, 3) of the key, of waste, of being out of step
    column_offsets: NDArray[np.int64]  # (columns + 1,)
    column: NDArray[np.int32]  # (n,) contours, column after column, each in source order
    succ_offsets: NDArray[np.int64]
    succs: NDArray[np.int32]


class Pool(NamedTuple):
    """What is left to do; written as contours are put."""

    first: NDArray[np.int64]  # (columns,) row of `column` that may still be to do
    missing: NDArray[np.int32]  # (n,) what it rests on that was not put
    ready: NDArray[np.float64]  # (n,) when it may begin, once nothing is missing
    put: NDArray[np.bool_]  # (n,)
    now: NDArray[np.float64]  # (heads,) each head has decided up to here
    about: NDArray[np.int64]  # (heads,) contour it printed last; NONE
    shut: NDArray[np.float64]  # (heads, columns) when at the soonest a head may begin the first
    looked: NDArray[np.int64]  # (heads, columns) row of `column` that `shut` is about
    stood: NDArray[np.int64]  # (heads,) unit after which `shut` was written
    asleep: NDArray[np.float64]  # (heads,) it could begin nothing before, when it looked last
    seen: NDArray[np.int64]  # (heads,) units put when it looked last; -1: never
    room: NDArray[np.float64]  # (k, 6) held by others now, see `held_by_others`
    holder: NDArray[np.int64]  # (k,)
    release: NDArray[np.float64]  # (k,)


@kernel
def new_pool(visits: Visits, policy: Policy, heads: int) -> Pool:
    """Nothing put yet."""
    n, columns = len(visits.ends), len(policy.column_offsets) - 1
    missing = np.empty(n, np.int32)
    for c in range(n):
        missing[c] = visits.pred_offsets[c + 1] - visits.pred_offsets[c]
    return Pool(
        policy.column_offsets[:-1].copy(),
        missing,
        np.zeros(n),
        np.zeros(n, np.bool_),
        np.zeros(heads),
        np.full(heads, NONE),
        np.zeros((heads, columns)),
        np.full((heads, columns), NONE),
        np.full(heads, NONE),
        np.zeros(heads),
        np.full(heads, -1),
        np.empty((3 * heads + 3, 6)),
        np.empty(3 * heads + 3, np.int64),
        np.empty(3 * heads + 3),
    )


@inlined
def next_head(heads: Heads, pool: Pool) -> tuple[int, float]:
    """Return the head that decides next, and when."""
    first, start = 0, np.inf
    for r in range(len(pool.now)):
        at = max(heads.free[r], pool.now[r])
        if at < start:
            first, start = r, at
    return first, start


@inlined
def hold(u: int, start: float, visits: Visits, units: Units) -> tuple[Room, float]:
    """Return what room unit u holds at `start`, and when it gives some of it back."""
    room, begin, end = room_at(units.room, u), units.begin[u], units.end[u]
    if begin > start:
        return room, begin
    c, seconds = units.contour[u], end - begin
    if c == NONE:
        return room, end
    row = 2 * c + units.backwards[u]
    for k in range(visits.pieces.offsets[row] + 1, visits.pieces.offsets[row + 1]):
        at = begin + visits.pieces.share[k] * seconds
        if at > start:
            return room, at
        room = room_at(visits.pieces.room, k)
    return room, end


@inlined
def held_by_others(
    r: int,
    start: float,
    visits: Visits,
    units: Units,
    heads: Heads,
    pool: Pool,
) -> tuple[int, float]:
    """Write to `pool.room` what other heads hold at `start`; how many, and until when.

    That is until any of it is given back, or another head decides.
    """
    count, until = 0, np.inf
    for s in range(len(heads.free)):
        if s == r:
            continue
        decides = max(heads.free[s], pool.now[s])
        if decides > start + LATER:
            until = min(until, decides)
        u = heads.last[s]
        while u != NONE and units.end[u] > start + LATER and count < len(pool.holder):
            held, at = hold(u, start + LATER, visits, units)
            until = min(until, max(start + LATER, at))
            keep_room(held, pool.room, count)
            pool.holder[count], pool.release[count] = s, at
            count += 1
            u = units.before[u]
    return count, until


@inlined
def out_of_step(
    r: int, u: int, start: float, place: NDArray[np.float64], free: NDArray[np.float64],
    about: NDArray[np.int64],
) -> float:  # fmt: skip
    """How far u is from where head r's sweep should be beside the others' contours."""
    off = 0.0
    for s in range(len(about)):
        if s != r and about[s] != NONE and free[s] > start:
            off += abs(place[r, u] - place[s, about[s]])
    return off


@inlined
def nearer_end(
    at: Point, u: int, visits: Visits, travel: NDArray[np.float64]
) -> tuple[float, bool]:
    """Seconds to the end of a contour that is reached sooner, and whether it is its last."""
    there = travel_seconds(at, end_of(u, 0, visits), travel)
    if visits.reversible[u]:
        back = travel_seconds(at, end_of(u, 1, visits), travel)
        if back < there:
            return back, True
    return there, False


@inlined
def held_until(
    r: int,
    wanted: Room,
    count: int,
    pool: Pool,
    fleet: Fleet,
) -> float:
    """Until when at least others hold some of the room head r wants; -inf: it is free."""
    until = -np.inf
    for k in range(count):
        if pool.release[k] > until and too_near(
            wanted, room_at(pool.room, k), r, pool.holder[k], fleet
        ):
            until = pool.release[k]
    return until


@inlined
def first_of(column: int, policy: Policy, pool: Pool) -> int:
    """First contour of a column not yet put; NONE: all were (mutates pool)."""
    end = policy.column_offsets[column + 1]
    while pool.first[column] < end and pool.put[policy.column[pool.first[column]]]:
        pool.first[column] += 1
    return policy.column[pool.first[column]] if pool.first[column] < end else NONE


@inlined
def may_sleep(r: int, start: float, units: Units, heads: Heads, pool: Pool) -> bool:
    """Whether nothing can have opened for head r since it looked last (mutates pool)."""
    if pool.stood[r] != heads.last[r]:
        pool.looked[r], pool.stood[r] = NONE, heads.last[r]
    unseen: bool = pool.seen[r] < units.used[0]
    return not unseen and bool(start + SURE < pool.asleep[r])


@inlined
def room_free_from(
    r: int, u: int, back: bool, at: Point, count: int, visits: Visits, fleet: Fleet, pool: Pool
) -> float:
    """When at the soonest head r may have the room of contour u and the way there; -inf: now."""
    side = 1 if back else 0
    held = room_at(visits.pieces.room, visits.pieces.offsets[2 * u + side])
    way = room_of_travel(at, end_of(u, side, visits), fleet.ceiling)
    return max(held_until(r, held, count, pool, fleet), held_until(r, way, count, pool, fleet))


@inlined
def choose(
    r: int, start: float, visits: Visits, fleet: Fleet, policy: Policy, units: Units,
    heads: Heads, pool: Pool,
) -> tuple[int, bool, float]:  # fmt: skip
    """Return the contour head r should print next, and whether backwards; NONE: wait until when.

    What is shut till some time is not looked at sooner (`Pool.shut`): more that is put opens
    nothing that was looked at, unless this head moves.
    """
    at = (heads.at[r, 0], heads.at[r, 1], heads.at[r, 2])
    count, until = held_by_others(r, start, visits, units, heads, pool)
    if may_sleep(r, start, units, heads, pool) and until < np.inf:
        return NONE, False, until
    lagging = len(visits.lags.below) > 0
    asleep = -np.inf if lagging else np.inf
    best, chosen, turned, cooled = np.inf, NONE, False, np.inf
    by_key, by_waste, by_step = policy.weights[r, 0], policy.weights[r, 1], policy.weights[r, 2]
    for column in range(len(pool.first)):
        u, row = first_of(column, policy, pool), pool.first[column]
        if u == NONE or pool.missing[u] > 0 or not policy.eligible[u, r]:
            continue
        if pool.looked[r, column] == row and start + SURE < pool.shut[r, column] and until < np.inf:
            asleep = min(asleep, pool.shut[r, column])
            continue
        score = by_key * policy.key[r, u]
        if score >= best:
            continue
        if by_step > 0.0:
            score += by_step * out_of_step(r, u, start, policy.place, heads.free, pool.about)
        there, back = nearer_end(at, u, visits, fleet.travel[r])
        lost, seconds = max(there, pool.ready[u] - start), visits.seconds[r, u]
        score += by_waste * lost / (seconds + lost + LATER)
        if score >= best:
            continue
        late = lost > there + PATIENCE * seconds
        opens = pool.ready[u] - there - PATIENCE * seconds
        if not late:
            opens = room_free_from(r, u, back, at, count, visits, fleet, pool)
        if opens > -np.inf and until < np.inf:
            pool.shut[r, column], pool.looked[r, column] = opens, NONE if lagging else row
            asleep = min(asleep, opens)
            cooled = min(cooled, start + max(LATER, lost - there)) if late else cooled
        else:
            best, chosen, turned = score, u, back
    pool.seen[r], pool.asleep[r] = units.used[0], asleep
    return chosen, turned, min(until, cooled) if lagging else until


@kernel
def first_left(lowest: int, pool: Pool) -> int:
    """Lowest contour not yet put, from `lowest` on: everything it rests on was put."""
    while pool.put[lowest]:
        lowest += 1
    return lowest


@inlined
def take(r: int, c: int, visits: Visits, policy: Policy, heads: Heads, pool: Pool) -> None:
    """Note that head r prints c (mutates pool)."""
    pool.put[c], pool.about[r] = True, c
    for k in range(policy.succ_offsets[c], policy.succ_offsets[c + 1]):
        s = policy.succs[k]
        pool.missing[s] -= 1
        if pool.missing[s] == 0:
            pool.ready[s] = rests_on(s, visits, heads)


@kernel
def dispatch(visits: Visits, fleet: Fleet, policy: Policy) -> tuple[Units, int]:
    """Print everything; returns the units in the order they were put and OK or SHUT_IN."""
    heads, n = len(fleet.parks), len(visits.ends)
    units, state = units_for(n, heads), all_parked(n, fleet)
    pool = new_pool(visits, policy, heads)
    left, lowest = n, 0
    while left > 0:
        r, start = next_head(state, pool)
        c, back, until = choose(r, start, visits, fleet, policy, units, state, pool)
        if c == NONE and until < np.inf:
            pool.now[r] = until
            continue
        if c == NONE:
            c = lowest = first_left(lowest, pool)
            while not policy.eligible[c, r]:
                r = (r + 1) % heads
        units = room_enough(units, heads)
        if not print_next(r, c, back, visits, fleet, units, state):
            return units, SHUT_IN
        take(r, c, visits, policy, state, pool)
        left -= 1
    units = room_enough(units, heads)
    return units, OK if return_all(visits, fleet, units, state) else SHUT_IN
