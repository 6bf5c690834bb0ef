"""What is printed over what, and orders in which nothing is printed over too soon.

A *lag* says how long after the end of contour a the contour b above it may
begin. `follow` times a sequence with its waits and, if asked, fills the waits
with work that is further down the sequence and can be done now.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from decmcts.arrays import Floats, Int32s, Ints
from decmcts.compiled import kernel
from decmcts.feasibility.clearance_kernels import Centrelines
from decmcts.feasibility.closure_kernels import touches
from decmcts.print.lags_kernels import Lags
from decmcts.team.engine.joint_kernels import Visits
from decmcts.team.engine.spaces_kernels import travel_seconds

NONE = -1
NEVER = np.inf
SHORT_S = 1e-3  # a wait below this is none
TIE_MM = 1e-4  # heights and distances nearer than this are equal


class CoolingProgress(NamedTuple):
    """How far a sequence is printed; all arrays are written as it goes on."""

    ended: Floats  # (n,) end of each contour, NEVER: not ended
    ready: Floats  # (n,) soonest begin of each available contour, when all has cooled
    missing: Ints  # (n,) predecessors not yet printed
    available: Int32s  # (n,) contours that could be next: the first n_available
    place: Ints  # (n,) place of each in `available`, NONE if not there
    n_available: Ints  # (1,)


@kernel
def printed_over(
    beads: Centrelines,
    by_top: Int32s,
    top: Floats,
    height: Floats,
    width: Floats,
) -> tuple[Ints, Int32s]:
    """Return the contours right below each contour, in CSR form.

    `by_top` are the contours by the height of their top, `top` these heights. a
    is right below b if it ends less than half b's height below where b's bead begins,
    or at most that above (as does the layer under a bridge of twice its height), and
    one's centreline runs over the other's bead.
    """
    n = len(width)
    offsets = np.zeros(n + 1, np.int64)
    found = np.empty(4 * n + 16, np.int32)
    used = 0
    for b in range(n):
        floor = beads.boxes[b, 4] - height[b]
        first = np.searchsorted(top, floor - height[b] / 2 + TIE_MM)
        last = np.searchsorted(top, floor + height[b] / 2 + TIE_MM)
        for at in range(first, last):
            a = by_top[at]
            if a < b and touches(beads, a, b, max(width[a], width[b]) / 2 + TIE_MM):
                if used == len(found):
                    more = np.empty(2 * used, np.int32)
                    more[:used] = found
                    found = more
                found[used] = a
                used += 1
        offsets[b + 1] = used
    return offsets, found[:used].copy()


@kernel
def make_available(c: int, lags: Lags, progress: CoolingProgress) -> None:
    """Add a contour whose predecessors are printed to those that could be next."""
    soonest = 0.0
    for e in range(lags.offsets[c], lags.offsets[c + 1]):
        soonest = max(soonest, progress.ended[lags.below[e]] + lags.seconds[e])
    progress.ready[c] = soonest
    progress.available[progress.n_available[0]] = c
    progress.place[c] = progress.n_available[0]
    progress.n_available[0] += 1


@kernel
def take(
    c: int,
    ended: float,
    succ_offsets: Ints,
    succs: Int32s,
    lags: Lags,
    progress: CoolingProgress,
) -> None:
    """Count a contour as printed and free those that waited for it."""
    progress.ended[c] = ended
    hole = progress.place[c]
    progress.n_available[0] -= 1
    moved = progress.available[progress.n_available[0]]
    progress.available[hole] = moved
    progress.place[moved] = hole
    progress.place[c] = NONE
    for e in range(succ_offsets[c], succ_offsets[c + 1]):
        progress.missing[succs[e]] -= 1
        if progress.missing[succs[e]] == 0:
            make_available(succs[e], lags, progress)


@kernel
def filler(
    c: int,
    now: float,
    at: Floats,
    visits: Visits,
    travel: Floats,
    progress: CoolingProgress,
) -> int:
    """Return the contour to print while c cools, the soonest there, or c if none saves time."""
    begin = max(now + travel_seconds(at, visits.ends[c, 0], travel), progress.ready[c])
    best, least = c, begin
    for k in range(progress.n_available[0]):
        d = progress.available[k]
        if d == c or progress.ready[d] >= least:
            continue
        there = max(now + travel_seconds(at, visits.ends[d, 0], travel), progress.ready[d])
        if there >= least:
            continue
        back = travel_seconds(visits.ends[d, 1], visits.ends[c, 0], travel)
        if (
            max(there + visits.seconds[0, d] + back, progress.ready[c]) - visits.seconds[0, d]
            < begin
        ):
            best, least = d, there
    return best


@kernel
def follow(
    order: Int32s,
    start: Floats,
    visits: Visits,
    succ_offsets: Ints,
    succs: Int32s,
    lags: Lags,
    travel: Floats,
    fill: bool,
) -> tuple[Int32s, float, float]:
    """Print a sequence, waiting where it must; return what was printed when in a row.

    Returns the order (with `fill` waits are filled with later work), the
    seconds to the end of the last contour and the seconds waited in all.
    """
    n = len(order)
    progress = CoolingProgress(
        np.full(n, NEVER), np.zeros(n), np.diff(visits.pred_offsets), np.empty(n, np.int32),
        np.full(n, NONE, np.int64), np.zeros(1, np.int64),
    )  # fmt: skip
    for c in range(n):
        if progress.missing[c] == 0:
            make_available(c, lags, progress)
    made = np.empty(n, np.int32)
    now, waited, head = 0.0, 0.0, 0
    at = start.copy()
    for k in range(n):
        while progress.ended[order[head]] != NEVER:
            head += 1
        c = order[head]
        arrival = now + travel_seconds(at, visits.ends[c, 0], travel)
        if fill and progress.ready[c] > arrival + SHORT_S:
            c = filler(c, now, at, visits, travel, progress)
            arrival = now + travel_seconds(at, visits.ends[c, 0], travel)
        wait = progress.ready[c] - arrival
        if wait <= SHORT_S:
            wait = 0.0
        waited += wait
        now = arrival + wait + visits.seconds[0, c]
        take(c, now, succ_offsets, succs, lags, progress)
        made[k] = c
        at[:] = visits.ends[c, 1]
    return made, now, waited
