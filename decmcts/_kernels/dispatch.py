"""List scheduling for several heads: who prints what next, on bare arrays.

Whenever a head is idle it looks at all contours that are ready and takes the
one that wastes least. Waste is measured with the duals of the matching behind
the makespan bound: a contour of price 1 is scarce and must always be printed
beside one of price 0; printing u beside v wastes price(u) + price(v) - 1 of
their common time, printing alone wastes price(u), waiting the other's price.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.conflict import conflicts
from decmcts._kernels.jit import kernel
from decmcts._kernels.units import (
    NONE,
    NOT_YET,
    OK,
    STUCK,
    UNIT_PARK,
    Floor,
    State,
    Units,
    Visits,
    at_park,
    begin_print,
    end_next,
    is_clear,
    make_way,
    new_units,
    start_state,
    travel_seconds,
    try_retreat,
    unit_box,
)


class Policy(NamedTuple):
    """What guides the choice."""

    price: NDArray[np.float64]  # (n,) dual of the matching
    place: NDArray[np.float64]  # (heads, n) position in the head's sweep, 0..1
    key: NDArray[np.float64]  # (heads, n) seconds of waste a choice may cost; inf: not its own
    reversible: NDArray[np.bool_]  # (n,)
    knobs: NDArray[np.float64]  # (heads, 6) see KNOB_*
    succ_offsets: NDArray[np.int64]
    succs: NDArray[np.int32]


class Pool(NamedTuple):
    """Contours that are ready; written as the print goes on."""

    ids: NDArray[np.int32]  # (n,)
    size: NDArray[np.int64]  # (1,)
    missing: NDArray[np.int32]  # (n,) predecessors not yet ended
    running: NDArray[np.int64]  # (heads,) contour each head is about; NONE
    left: NDArray[np.int64]  # (1,) contours not yet begun
    backwards: NDArray[np.bool_]  # (n,)


KNOB_WASTE, KNOB_TRAVEL, KNOB_KEY, KNOB_ALONE, KNOB_WAIT, KNOB_STEP = 0, 1, 2, 3, 4, 5


@kernel
def new_pool(visits: Visits, heads: int) -> Pool:
    """Everything without predecessors is ready."""
    n = len(visits.seconds)
    pool = Pool(
        np.empty(n, np.int32),
        np.zeros(1, np.int64),
        np.empty(n, np.int32),
        np.full(heads, NONE),
        np.full(1, n),
        np.zeros(n, np.bool_),
    )
    for c in range(n):
        pool.missing[c] = visits.pred_offsets[c + 1] - visits.pred_offsets[c]
        if pool.missing[c] == 0:
            pool.ids[pool.size[0]] = c
            pool.size[0] += 1
    return pool


@kernel
def settle(state: State, policy: Policy, pool: Pool) -> None:
    """Heads that are idle have ended their contour: what rests on it may be ready now."""
    for r in range(len(pool.running)):
        c = pool.running[r]
        if c == NONE or state.until[r] < NOT_YET:
            continue
        pool.running[r] = NONE
        for k in range(policy.succ_offsets[c], policy.succ_offsets[c + 1]):
            s = policy.succs[k]
            pool.missing[s] -= 1
            if pool.missing[s] == 0:
                pool.ids[pool.size[0]] = s
                pool.size[0] += 1


@kernel
def nearer_end(
    c: int, rest: NDArray[np.float64], visits: Visits, policy: Policy, floor: Floor
) -> tuple[float, bool]:
    """Seconds to the end of the contour that is reached sooner, and whether it is its last."""
    there = travel_seconds(rest, visits.first[c], floor.travel)
    if policy.reversible[c]:
        back = travel_seconds(rest, visits.last[c], floor.travel)
        if back < there:
            return back, True
    return there, False


@kernel
def uncovered(
    r: int, u: int, alone: float, visits: Visits, floor: Floor, policy: Policy, pool: Pool
) -> float:
    """Waste of printing u for `alone` seconds beside what is ready for the other heads."""
    price = policy.price[u]
    lost: float = alone * price
    free = alone
    for s in range(len(pool.running)):
        if s == r:
            continue
        for k in range(pool.size[0]):
            v = pool.ids[k]
            rate = max(0.0, price + policy.price[v] - 1.0)
            if rate >= price or v == u or policy.key[s, v] == np.inf:
                continue
            if not conflicts(visits.boxes[u], visits.boxes[v], floor.gaps[r, s]):
                covered = min(free, visits.seconds[v])
                lost -= covered * (price - rate)
                free -= covered
                if free <= 0.0:
                    return lost
    return lost


@kernel
def waste(
    r: int,
    u: int,
    travel: float,
    now: float,
    visits: Visits,
    floor: Floor,
    state: State,
    policy: Policy,
    pool: Pool,
) -> float:
    """Seconds of makespan that head r wastes if it sets off to u now."""
    seconds = travel + visits.seconds[u]
    alone = seconds
    lost = 0.0
    for s in range(len(pool.running)):
        v = pool.running[s]
        if s != r and v != NONE:
            beside = min(seconds, state.until[s] - now)
            alone = min(alone, seconds - beside)
            lost += beside * max(0.0, policy.price[u] + policy.price[v] - 1.0)
    if alone > 0.0 and policy.price[u] > 0.0:
        lost += policy.knobs[r, KNOB_ALONE] * uncovered(r, u, alone, visits, floor, policy, pool)
    return lost


@kernel
def out_of_step(r: int, u: int, policy: Policy, pool: Pool) -> float:
    """How far u is from where head r's sweep should be beside the others' contours."""
    off = 0.0
    for s in range(len(pool.running)):
        if s != r and pool.running[s] != NONE:
            off += abs(policy.place[r, u] - policy.place[s, pool.running[s]])
    return off


@kernel
def choose(
    r: int,
    now: float,
    visits: Visits,
    floor: Floor,
    state: State,
    policy: Policy,
    pool: Pool,
) -> tuple[float, int, bool]:
    """Score and place in the pool of what head r should set off to now, and whether backwards."""
    best, chosen, turned = np.inf, NONE, False
    patience = np.inf
    for s in range(len(pool.running)):
        if s != r and pool.running[s] != NONE:
            patience = policy.price[pool.running[s]] * (state.until[s] - now)
    box = np.empty(4)
    for k in range(pool.size[0]):
        u = pool.ids[k]
        if policy.key[r, u] == np.inf:
            continue
        score = policy.knobs[r, KNOB_KEY] * policy.key[r, u]
        score += policy.knobs[r, KNOB_STEP] * out_of_step(r, u, policy, pool)
        if score >= best:
            continue
        unit_box(state.rest[r], visits.boxes[u], box)
        if not is_clear(r, box, state, floor):
            continue
        travel, back = nearer_end(u, state.rest[r], visits, policy, floor)
        seconds = travel + visits.seconds[u] + 1e-9
        score += policy.knobs[r, KNOB_TRAVEL] * travel / seconds
        if score >= best:
            continue
        lost = waste(r, u, travel, now, visits, floor, state, policy, pool)
        if lost > patience + policy.knobs[r, KNOB_WAIT] * seconds:
            continue
        score += policy.knobs[r, KNOB_WASTE] * lost / seconds
        if score < best:
            best, chosen, turned = score, k, back
    return best, chosen, turned


@kernel
def set_off(
    r: int,
    place: int,
    back: bool,
    now: float,
    visits: Visits,
    floor: Floor,
    state: State,
    units: Units,
    pool: Pool,
) -> None:
    """Send head r to the contour at `place` of the pool (mutates state, units, pool)."""
    c = pool.ids[place]
    pool.size[0] -= 1
    pool.ids[place] = pool.ids[pool.size[0]]
    pool.backwards[c] = back
    pool.running[r] = c
    pool.left[0] -= 1
    first = visits.last[c] if back else visits.first[c]
    last = visits.first[c] if back else visits.last[c]
    begin_print(r, c, now, first, last, visits, floor, state, units)


@kernel
def dispatch(visits: Visits, floor: Floor, policy: Policy, most: int) -> tuple[Units, Pool, int]:
    """Print everything; returns the units in the order decided and OK or STUCK."""
    heads = len(floor.parks)
    state = start_state(visits, floor, np.zeros(heads))
    units = new_units(most)
    pool = new_pool(visits, heads)
    now = 0.0
    while True:
        settle(state, policy, pool)
        while begin_best(now, visits, floor, state, policy, units, pool):
            pass
        for r in range(heads):
            if pool.left[0] == 0 and state.until[r] == NOT_YET and not at_park(r, floor, state):
                try_retreat(r, UNIT_PARK, floor.parks[r], now, floor, state, units)
        if state.until.min() == NOT_YET:
            if pool.left[0] == 0:
                return units, pool, OK
            if units.used[0] + 3 * heads > most:
                return units, pool, STUCK
            if not unjam(now, visits, floor, state, policy, units, pool):
                return units, pool, STUCK
        now = end_next(state)


@kernel
def unjam(
    now: float,
    visits: Visits,
    floor: Floor,
    state: State,
    policy: Policy,
    units: Units,
    pool: Pool,
) -> bool:
    """Nothing runs and nothing can begin: send aside who rests in the way of the best choice."""
    best, head, wanted = np.inf, NONE, np.empty(4)
    for r in range(len(pool.running)):
        for k in range(pool.size[0]):
            u = pool.ids[k]
            travel = travel_seconds(state.rest[r], visits.first[u], floor.travel)
            score = travel + policy.key[r, u]
            if score < best:
                best, head = score, r
                unit_box(state.rest[r], visits.boxes[u], wanted)
    return head != NONE and make_way(head, wanted, now, floor, state, units)


@kernel
def begin_best(
    now: float,
    visits: Visits,
    floor: Floor,
    state: State,
    policy: Policy,
    units: Units,
    pool: Pool,
) -> bool:
    """Of the idle heads let the one with the best choice set off; False: none should."""
    least, head, place, turned = np.inf, NONE, NONE, False
    for r in range(len(pool.running)):
        if state.until[r] == NOT_YET:
            score, k, back = choose(r, now, visits, floor, state, policy, pool)
            if k != NONE and score < least:
                least, head, place, turned = score, r, k, back
    if head == NONE:
        return False
    set_off(head, place, turned, now, visits, floor, state, units, pool)
    return True
