"""What all searches in windows of a joint order share, and `join`, on bare arrays.

Where they look, how what they try is judged, and how it is taken back.

The *tail* of a head at a turn is the longest path through the partial order from the end of
its last unit before that turn to the end of the print, the travel to its park included. A
head that is free at `free` there delays the print exactly if `free` + tail is more than the
makespan. Where it is less the head has slack.

`join` takes from another joint order the windows in which it is better. Both orders print the
same contours up to where a window begins and up to where it ends. So each window is carried out
by itself and judged by heads and tails; what all of them make of the print is found at the end.

References
----------
Balas & Vazacopoulos 1998, "Guided local search with shifting bottleneck for job shop
scheduling", Management Science 44(2): moves judged by heads and tails.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Ints
from decmcts.compiled import inlined, kernel
from decmcts.random_kernels import below, log_uniform
from decmcts.team.engine.joint_kernels import NONE, TeamState, Units, Visits
from decmcts.team.engine.replay_kernels import JointOrder, Marks, finish, link, replay, restore
from decmcts.team.engine.spaces_kernels import Fleet, travel_seconds
from decmcts.team.engine.waits_kernels import AT_END, find_waits

GIVEN_UP = 1.0  # seconds too late, at which a move is not carried out to its end
CONTOURS_A_WINDOW = 1_000  # contours of an order for each window of a batch
LEAST, MOST = 4, 32  # windows of a batch
LATENESS_WEIGHT = 0.1  # weight of all heads' lateness beside that of the print


class Window(NamedTuple):
    """Some turns of a joint order, one after the other."""

    order: Ints  # contours
    head: Ints  # aligned with order, here and below
    reversed: Flags


@kernel
def join(
    makespan: float, windows: Ints, order: Ints, head: Ints, is_reversed: Flags, joint: JointOrder,
    visits: Visits, fleet: Fleet, units: Units, heads: TeamState, marks: Marks,
) -> float:  # fmt: skip
    """Take what is better of another order; return the makespan, which never grows.

    Mutates all but visits, fleet. `windows` (k, 2) are the first turns and ends of where the
    other order differs, ascending; it is `order`, `head` and `is_reversed`, all by turn.
    """
    if not update_tails(joint, visits, fleet, units, heads, marks):
        return np.inf
    kept, there = copy_window(0, len(joint.order), joint), True
    for begin, end in windows:
        there = there and replay(end, joint, visits, fleet, units, heads, marks)
        if not there:
            break
        before = lateness(end, fleet, marks)
        mine = copy_window(begin, end, joint)
        other = Window(order[begin:end], head[begin:end], is_reversed[begin:end])
        place_window(begin, other, joint, marks)
        better = replay(end, joint, visits, fleet, units, heads, marks)
        if not better or lateness(end, fleet, marks) >= before:
            place_window(begin, mine, joint, marks)
    found = np.inf
    if there:
        link(joint, marks.free.shape[1])
        found = finish(marks.known[0], joint, visits, fleet, units, heads, marks)
    if found <= makespan:
        return found
    undo(0, kept, joint, marks)
    return makespan


@kernel
def share_at(unit: int, point: int, visits: Visits, units: Units) -> float:
    """Share of a unit's time after which vertex `point` of its contour was passed."""
    row = 2 * units.contour[unit] + units.reversed[unit]
    for k in range(visits.pieces.offsets[row], visits.pieces.offsets[row + 1]):
        if visits.pieces.point[k] == point:
            share: float = visits.pieces.share[k]
            return share
    return 1.0


@kernel
def longest_paths(visits: Visits, fleet: Fleet, units: Units) -> Floats:
    """Return the longest path from the end of each unit to the end of all, (m,) seconds."""
    m, heads, waits = units.used[0], len(fleet.parks), find_waits(visits, fleet, units)
    way, behind = np.zeros(m), np.zeros(m)  # from the begin; what waits for the end
    for r in range(heads):
        if waits.counts[r] > 0:
            u = waits.rows[r, waits.counts[r] - 1]
            behind[u] = travel_seconds(units.target[u], fleet.parks[r], fleet.travel[r])
    for row in range(m - 1, -1, -1):
        way[row] = max(way[row], units.end[row] - units.begin[row] + behind[row])
        if (waits.after[row] != NONE).any():
            way[row] += fleet.rest_s
        if units.before[row] != NONE:
            behind[units.before[row]] = max(behind[units.before[row]], way[row])
        for s in range(heads):
            if waits.after[row, s] == NONE:
                continue
            u = waits.rows[s, waits.after[row, s]]
            if waits.point[row, s] == AT_END:
                behind[u] = max(behind[u], way[row])
            else:
                passed = share_at(u, waits.point[row, s], visits, units)
                way[u] = max(way[u], passed * (units.end[u] - units.begin[u]) + way[row])
        c = units.contour[row]
        if c != NONE:
            for k in range(visits.lags.offsets[c], visits.lags.offsets[c + 1]):
                u = waits.place[visits.lags.below[k]]
                behind[u] = max(behind[u], visits.lags.seconds[k] + way[row])
    return behind


@kernel
def find_tails(visits: Visits, fleet: Fleet, units: Units, marks: Marks) -> None:
    """Write the tail of every head at every turn to `marks.tail`; all turns must be known."""
    behind = longest_paths(visits, fleet, units)
    for turn in range(len(marks.used)):
        for r in range(len(fleet.parks)):
            u = marks.last[turn, r]
            marks.tail[turn, r] = behind[u] if u != NONE else 0.0


@inlined
def batch_of(n: int, windows: int) -> int:
    """How many of `windows` windows of an order of n contours are searched together.

    Tails and makespan are found once a batch, which takes longer the longer the order is.
    """
    return int(min(windows, max(LEAST, min(MOST, n // CONTOURS_A_WINDOW))))


@kernel
def draw_windows(
    count: int, n: int, shortest: int, longest: int, least: int, state: NDArray[np.uint64]
) -> Ints:
    """Draw `count` windows, first turn and end, by their ends, (count, 2).

    Of at least `least` turns, all of a small order. Lengths are log-uniform; each turn is as
    likely to be in one. In this order no window changes what the tails behind a later one are
    made of.
    """
    drawn = np.empty((count, 2), np.int64)
    for k in range(count):
        length = int(log_uniform(state, shortest, longest))
        width = min(n, max(least, length))
        low = min(max(0, below(state, n + width) - width), n - width)
        at = k
        while at > 0 and drawn[at - 1, 1] > low + width:
            drawn[at, 0], drawn[at, 1] = drawn[at - 1, 0], drawn[at - 1, 1]
            at -= 1
        drawn[at, 0], drawn[at, 1] = low, low + width
    return drawn


@inlined
def update_tails(
    joint: JointOrder, visits: Visits, fleet: Fleet, units: Units, heads: TeamState, marks: Marks
) -> bool:
    """Mark all turns and find their tails (mutates units, heads, marks).

    False: the order cannot be carried out. Units that a trial left behind those of the marks
    are no part of the order.
    """
    n = len(joint.order)
    if not replay(n, joint, visits, fleet, units, heads, marks):
        return False
    restore(n, units, heads, marks)
    find_tails(visits, fleet, units, marks)
    return True


@inlined
def latest_end(turn: int, fleet: Fleet, marks: Marks) -> float:
    """When the print ends, judged by heads and tails at a marked turn."""
    latest = -np.inf
    for r in range(marks.free.shape[1]):
        tail = marks.tail[turn, r]
        if turn == len(marks.used) - 1:
            tail = travel_seconds(marks.at[turn, r], fleet.parks[r], fleet.travel[r])
        latest = max(latest, marks.free[turn, r] + tail)
    return latest


@inlined
def lateness(turn: int, fleet: Fleet, marks: Marks) -> float:
    """When the print ends by what is marked at a turn, and a little of when each head is free."""
    late: float = latest_end(turn, fleet, marks) + LATENESS_WEIGHT * marks.free[turn].sum()
    return late


@inlined
def copy_window(begin: int, end: int, joint: JointOrder) -> Window:
    """Return turns begin..end - 1 as they are."""
    order = joint.order[begin:end].copy()
    return Window(order, joint.head[order], joint.reversed[order])


@inlined
def place_window(begin: int, window: Window, joint: JointOrder, marks: Marks) -> None:
    """Write turns from `begin` on, of the same contours (mutates joint, marks).

    Turns and neighbours of contours are found anew by `link`.
    """
    for k in range(len(window.order)):
        c = window.order[k]
        joint.order[begin + k] = c
        joint.head[c], joint.reversed[c] = window.head[k], window.reversed[k]
    marks.known[0] = min(marks.known[0], begin)


@inlined
def undo(begin: int, kept: Window, joint: JointOrder, marks: Marks) -> None:
    """Let turns from `begin` on be as they were (mutates joint, marks)."""
    place_window(begin, kept, joint, marks)
    link(joint, marks.free.shape[1])


@inlined
def begin_trial(turn: int, units: Units, heads: TeamState, marks: Marks) -> None:
    """Go back to what held before a turn; units of a trial are written behind those of the marks.

    There they are left to be overwritten (mutates units, heads).
    """
    restore(turn, units, heads, marks)
    units.used[0] = marks.used[marks.known[0]]


@inlined
def with_lateness(later: float, weight: float, turn: int, heads: TeamState, marks: Marks) -> float:
    """Add by how much later than by the marks each head is free at a turn, times `weight`."""
    for r in range(len(heads.free)):
        later += weight * (heads.free[r] - marks.free[turn, r])
    return later
