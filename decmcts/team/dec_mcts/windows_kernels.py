"""What all searches in windows of a joint order share (`polish`, `recreate`, `join`).

Where they look, how what they try is judged, and how it is taken back.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.compiled import inlined, kernel
from decmcts.random_kernels import below, log_uniform
from decmcts.team.dec_mcts.tails_kernels import find_tails
from decmcts.team.engine.joint_kernels import TeamState, Units, Visits
from decmcts.team.engine.replay_kernels import JointOrder, Marks, link, replay, restore
from decmcts.team.engine.spaces_kernels import Fleet, travel_seconds

GIVEN_UP = 1.0  # seconds too late, at which a move is not carried out to its end
CONTOURS_A_WINDOW = 1_000  # contours of an order for each window of a batch
LEAST, MOST = 4, 32  # windows of a batch
LATENESS_WEIGHT = 0.1  # weight of all heads' lateness beside that of the print


class Window(NamedTuple):
    """Some turns of a joint order, one after the other."""

    order: NDArray[np.int64]  # contours
    head: NDArray[np.int64]  # aligned with order, here and below
    reversed: NDArray[np.bool_]


@inlined
def batch_of(n: int, windows: int) -> int:
    """How many of `windows` windows of an order of n contours are searched together.

    Tails and makespan are found once a batch, which takes longer the longer the order is.
    """
    return int(min(windows, max(LEAST, min(MOST, n // CONTOURS_A_WINDOW))))


@kernel
def draw_windows(
    count: int, n: int, shortest: int, longest: int, least: int, state: NDArray[np.uint64]
) -> NDArray[np.int64]:
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
