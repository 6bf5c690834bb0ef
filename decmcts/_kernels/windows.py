"""What all searches in windows of a joint order share (`polish`, `recreate`).

Where they look, how what they try is judged, and how it is taken back.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import inlined
from decmcts._kernels.joint import Heads, Units, Visits
from decmcts._kernels.random import below, uniform
from decmcts._kernels.replay import JointOrder, Marks, link, recall, replay
from decmcts._kernels.rooms import Fleet
from decmcts._kernels.tails import find_tails

GIVEN_UP = 1.0  # seconds too late, at which a move is not carried out to its end
FRESH = 4  # windows after which the tails are found anew


@inlined
def draw_window(
    n: int, shortest: int, longest: int, least: int, state: NDArray[np.uint64]
) -> tuple[int, int]:
    """Draw the first turn of a window and how many it has: `least` at least, all of a small order.

    Lengths are log-uniform; each turn is as likely to be in it.
    """
    drawn = int(shortest * (longest / shortest) ** uniform(state))
    width = min(n, max(least, drawn))
    return min(max(0, below(state, n + width) - width), n - width), width


@inlined
def keep_tails(
    drawn: int, joint: JointOrder, visits: Visits, fleet: Fleet, units: Units, heads: Heads,
    marks: Marks,
) -> bool:  # fmt: skip
    """Find the tails anew before every FRESH-th window (mutates marks); False: no room."""
    if drawn % FRESH:
        return True
    if not replay(len(joint.order), joint, visits, fleet, units, heads, marks):
        return False
    find_tails(visits, fleet, units, marks)
    return True


@inlined
def begin_trial(turn: int, units: Units, heads: Heads, marks: Marks) -> None:
    """Go back to what held before a turn; units of a trial are written behind those of the marks.

    There they are left to be overwritten (mutates units, heads).
    """
    recall(turn, units, heads, marks)
    units.used[0] = marks.used[marks.known[0]]


@inlined
def with_lateness(later: float, weight: float, turn: int, heads: Heads, marks: Marks) -> float:
    """Add by how much later than by the marks each head is free at a turn, times `weight`."""
    for r in range(len(heads.free)):
        later += weight * (heads.free[r] - marks.free[turn, r])
    return later


@inlined
def take_back(
    low: int, order: NDArray[np.int64], head: NDArray[np.int64], backwards: NDArray[np.bool_],
    joint: JointOrder, marks: Marks,
) -> None:  # fmt: skip
    """Let turns from `low` on be as they were (mutates joint, marks)."""
    for k in range(len(order)):
        c = order[k]
        joint.order[low + k], joint.head[c], joint.backwards[c] = c, head[k], backwards[k]
    link(joint, marks.free.shape[1])
    marks.known[0] = min(marks.known[0], low)
