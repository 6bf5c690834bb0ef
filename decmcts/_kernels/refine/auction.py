"""Sequential single-item auction of contours among heads, on bare arrays.

Of the contours that may be printed, those of least key are on offer. Every head that may
print one bids when it would have ended it; the lowest bid wins, and the contour is put.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.engine.aside import print_next, return_all
from decmcts._kernels.engine.carry_out import OK, SHUT_IN, units_for, with_capacity
from decmcts._kernels.engine.dispatch import Policy, Pool, first_of, nearer_end, new_pool, take
from decmcts._kernels.engine.joint import (
    NONE,
    Heads,
    Units,
    Visits,
    all_parked,
    clear_from,
    end_of,
    ready_at,
)
from decmcts._kernels.engine.rooms import Fleet, room_at, room_of_travel, travel_seconds
from decmcts._kernels.jit import inlined, kernel


@inlined
def bid(
    r: int, c: int, is_reversed: bool, visits: Visits, fleet: Fleet, units: Units, heads: Heads
) -> float:
    """When head r would have printed c after all that was put; heads at rest are not in the way."""
    side = 1 if is_reversed else 0
    at, there = (heads.at[r, 0], heads.at[r, 1], heads.at[r, 2]), end_of(c, side, visits)
    way = room_of_travel(at, there, fleet.ceiling)
    begin = clear_from(r, way, heads.free[r], visits, fleet, units, heads)
    begin += travel_seconds(at, there, fleet.travel[r])
    held = room_at(visits.pieces.room, visits.pieces.offsets[2 * c + side])
    begin = max(begin, ready_at(c, visits, heads))
    begin = clear_from(r, held, begin, visits, fleet, units, heads)
    ended: float = begin + visits.seconds[r, c]
    return ended


@kernel
def offer(policy: Policy, pool: Pool, offered: NDArray[np.int64]) -> int:
    """Write to `offered` the contours of least key that may be printed; returns how many."""
    count, keys = 0, np.empty(len(offered))
    for column in range(len(pool.first)):
        c = first_of(column, policy, pool)
        if c == NONE or pool.missing[c] > 0:
            continue
        key = policy.key[0, c]
        if count == len(offered) and key >= keys[count - 1]:
            continue
        at = min(count, len(offered) - 1)
        while at > 0 and keys[at - 1] > key:
            keys[at], offered[at] = keys[at - 1], offered[at - 1]
            at -= 1
        keys[at], offered[at] = key, c
        count = min(count + 1, len(offered))
    return count


@kernel
def winner(
    offered: NDArray[np.int64],
    visits: Visits,
    fleet: Fleet,
    policy: Policy,
    units: Units,
    heads: Heads,
) -> tuple[int, int, bool]:
    """Return the head that bids least, for which contour of those on offer, and its direction."""
    best, bidder, won, is_reversed = np.inf, NONE, NONE, False
    for c in offered:
        for r in range(len(heads.free)):
            if not policy.eligible[c, r] or heads.free[r] >= best:
                continue
            at = (heads.at[r, 0], heads.at[r, 1], heads.at[r, 2])
            _, back = nearer_end(at, c, visits, fleet.travel[r])
            ended = bid(r, c, back, visits, fleet, units, heads)
            if ended < best:
                best, bidder, won, is_reversed = ended, r, c, back
    return bidder, won, is_reversed


@kernel
def auction(visits: Visits, fleet: Fleet, policy: Policy, on_offer: int) -> tuple[Units, int]:
    """Auction everything, `on_offer` contours at a time; returns the units and OK or SHUT_IN."""
    heads, n = len(fleet.parks), len(visits.ends)
    units, state = units_for(n, heads), all_parked(n, fleet)
    pool, offered = new_pool(visits, policy, heads), np.empty(on_offer, np.int64)
    for _ in range(n):
        count = offer(policy, pool, offered)
        r, c, back = winner(offered[:count], visits, fleet, policy, units, state)
        units = with_capacity(units, heads)
        if not print_next(r, c, back, visits, fleet, units, state):
            return units, SHUT_IN
        take(r, c, visits, policy, state, pool)
    units = with_capacity(units, heads)
    return units, OK if return_all(visits, fleet, units, state) else SHUT_IN
