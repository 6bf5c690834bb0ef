"""Ruin and recreate of one joint order of several heads, on bare arrays.

The contours of a window of turns are dispatched anew (`decmcts.team.engine.dispatch_kernels`) by
some random policies; the best result takes the window's place if the print then ends sooner. How
much sooner is told by heads and tails, as in polishing, and then found by carrying out all.
So a policy need not suit the whole print: each window of it gets one that suits.

References
----------
Schrimpf, Schneider, Stamm-Wilbrandt & Dueck 2000, "Record breaking optimization results
using the ruin and recreate principle", Journal of Computational Physics 159(2).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Floats, Ints
from decmcts.compiled import apart, inlined, kernel
from decmcts.random_kernels import below, uniform
from decmcts.team.dec_mcts.windows_kernels import (
    GIVEN_UP,
    LATENESS_WEIGHT,
    batch_of,
    begin_trial,
    copy_window,
    draw_windows,
    undo,
    update_tails,
    with_lateness,
)
from decmcts.team.engine.aside_kernels import print_next
from decmcts.team.engine.dispatch_kernels import (
    OPEN,
    KeyTerms,
    Policy,
    Pool,
    next_print,
    take,
    wake,
    write_keys,
)
from decmcts.team.engine.joint_kernels import NONE, TeamState, Units, Visits, has_capacity, ready_at
from decmcts.team.engine.replay_kernels import (
    JointOrder,
    Marks,
    finish,
    later_by,
    link,
    replay,
)
from decmcts.team.engine.spaces_kernels import Fleet

SHORTEST, LONGEST = 100, 1500  # turns of a window
TRIES = 10  # policies for each
ALIKE = 0.5  # share of tries in which all heads have the same policy


class Guide(NamedTuple):
    """By what windows are dispatched; the last three are scratch."""

    policies: Floats  # (k, 6) see `decmcts.team.engine.plans.POLICIES`
    key_terms: KeyTerms
    row: Ints  # (n,) place of each contour in `Policy.column`
    policy: Policy  # its keys and weights are written
    pool: Pool
    found: Ints  # (2, n) by turn, (2 contour + reversed) heads + head: now, best


@inlined
def draw_policy(contours: Ints, guide: Guide, state: NDArray[np.uint64]) -> None:
    """Write keys of a window's contours, and all weights, by random policies (mutates guide)."""
    alike = uniform(state) < ALIKE
    row = below(state, len(guide.policies))
    for r in range(len(guide.policy.weights)):
        if r > 0 and not alike:
            row = below(state, len(guide.policies))
        chosen = guide.policies[row]
        for k in range(guide.policy.weights.shape[1]):
            guide.policy.weights[r, k] = chosen[k]
        write_keys(r, chosen, contours, guide.key_terms, guide.policy.key)


@inlined
def open_window(
    contours: Ints, visits: Visits, units: Units, heads: TeamState, guide: Guide
) -> None:
    """Say that these contours, and no others, are left to do (mutates guide)."""
    pool, policy = guide.pool, guide.policy
    pool.first[:], pool.is_open[:], pool.counts[:] = policy.column_offsets[1:], False, 0
    pool.decides_at[:], pool.earliest_row[:] = 0.0, NONE
    for r in range(len(heads.last)):
        pool.earliest_unit[r], pool.last_contour[r] = NONE, NONE
        if heads.last[r] != NONE:
            pool.last_contour[r] = units.contour[heads.last[r]]
    for c in contours:
        pool.placed[c] = False
    for c in contours:
        pool.missing[c] = 0
        for e in range(visits.pred_offsets[c], visits.pred_offsets[c + 1]):
            if not pool.placed[visits.preds[e]]:
                pool.missing[c] += 1
        if pool.missing[c] == 0:
            pool.ready[c] = ready_at(c, visits, heads)
        column = pool.column_of[c]
        pool.first[column] = min(pool.first[column], guide.row[c])
        if not pool.is_open[column]:
            pool.open[pool.counts[OPEN]], pool.is_open[column] = column, True
            pool.counts[OPEN] += 1


@apart
def dispatch_window(
    begin: int, contours: Ints, most: float, visits: Visits, fleet: Fleet,
    units: Units, heads: TeamState, marks: Marks, guide: Guide,
) -> float:  # fmt: skip
    """Dispatch the contours of a window that begins at turn `begin` (mutates units, heads, guide).

    Returns by how much later than by the marks the print then ends; infinite if that cannot
    be carried out, or as soon as some head makes it `most` later.
    """
    count, end, pool = len(heads.free), begin + len(contours), guide.pool
    begin_trial(begin, units, heads, marks)
    open_window(contours, visits, units, heads, guide)
    usual = -np.inf
    for r in range(count):
        usual = max(usual, marks.free[end, r] + marks.tail[end, r])
    left = 0  # of `contours`: where no head finds anything, the order as it was decides
    for turn in range(begin, end):
        r, c, back, start = next_print(visits, fleet, guide.policy, units, heads, pool)
        if c == NONE:
            while pool.placed[contours[left]]:
                left += 1
            c = contours[left]
            while not guide.policy.eligible[c, r]:
                r = (r + 1) % count
        if not has_capacity(units, count) or not print_next(
            r, c, back, visits, fleet, units, heads
        ):
            return np.inf
        if heads.free[r] + marks.tail[end, r] > usual + most:
            return np.inf
        take(r, c, visits, guide.policy, heads, pool)
        wake(r, start, visits, fleet, guide.policy, heads, pool)
        guide.found[0, turn] = (2 * c + back) * count + r
    later = later_by(end, fleet, heads, marks)
    late: float = with_lateness(later, LATENESS_WEIGHT, end, heads, marks)
    return late


@inlined
def best_of_tries(
    begin: int, contours: Ints, visits: Visits, fleet: Fleet, units: Units,
    heads: TeamState, marks: Marks, guide: Guide, state: NDArray[np.uint64],
) -> bool:  # fmt: skip
    """Write the best of some dispatches of a window to `guide.found[1]`; False: none is better."""
    end, least = begin + len(contours), 0.0
    ended = heads.ended[contours]
    for _ in range(TRIES):
        draw_policy(contours, guide, state)
        later = dispatch_window(
            begin, contours, least + GIVEN_UP, visits, fleet, units, heads, marks, guide
        )
        for c in contours:
            guide.pool.placed[c] = True
        if later < least:
            least = later
            for turn in range(begin, end):
                guide.found[1, turn] = guide.found[0, turn]
    for k in range(len(contours)):
        heads.ended[contours[k]] = ended[k]
    return least < 0.0


@inlined
def take_found(begin: int, end: int, joint: JointOrder, marks: Marks, guide: Guide) -> None:
    """Put the best dispatch of turns begin..end - 1 in their place (mutates joint, marks)."""
    count = marks.free.shape[1]
    for turn in range(begin, end):
        visit = guide.found[1, turn] // count
        c = visit // 2
        joint.order[turn], joint.reversed[c] = c, visit % 2 == 1
        joint.head[c] = guide.found[1, turn] % count
    link(joint, count)
    marks.known[0] = begin


@kernel
def recreate(
    makespan: float, windows: int, joint: JointOrder, visits: Visits, fleet: Fleet, units: Units,
    heads: TeamState, marks: Marks, guide: Guide, state: NDArray[np.uint64],
) -> float:  # fmt: skip
    """Ruin and recreate `windows` random windows; return the makespan, which never grows.

    Mutates all but visits, fleet. `makespan` is that of the order now.
    """
    n, left = len(joint.order), windows
    guide.pool.placed[:] = True
    while left > 0:
        if not update_tails(joint, visits, fleet, units, heads, marks):
            return np.inf
        drawn = draw_windows(batch_of(n, left), n, SHORTEST, LONGEST, SHORTEST, state)
        left -= len(drawn)
        for k in range(len(drawn)):
            begin, end = drawn[k]
            if not replay(end, joint, visits, fleet, units, heads, marks):
                return np.inf
            kept = copy_window(begin, end, joint)
            if not best_of_tries(
                begin, kept.order, visits, fleet, units, heads, marks, guide, state
            ):
                continue
            take_found(begin, end, joint, marks, guide)
            found = finish(end, joint, visits, fleet, units, heads, marks)
            if found <= makespan:
                makespan = found
            else:
                undo(begin, kept, joint, marks)
    return makespan
