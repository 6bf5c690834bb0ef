"""Takes from another joint order the windows in which it is better, on bare arrays.

Both orders print the same contours up to where a window begins and up to where it ends. So
each window is carried out by itself and judged by heads and tails; what all of them
make of the print is found once, at the end.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.compiled import inlined, kernel
from decmcts.team.dec_mcts.windows_kernels import (
    LATENESS_WEIGHT,
    Window,
    copy_window,
    latest_end,
    place_window,
    undo,
    update_tails,
)
from decmcts.team.engine.joint_kernels import TeamState, Units, Visits
from decmcts.team.engine.replay_kernels import JointOrder, Marks, finish, link, replay
from decmcts.team.engine.spaces_kernels import Fleet


@inlined
def lateness(turn: int, fleet: Fleet, marks: Marks) -> float:
    """When the print ends by what is marked at a turn, and a little of when each head is free."""
    late: float = latest_end(turn, fleet, marks) + LATENESS_WEIGHT * marks.free[turn].sum()
    return late


@kernel
def join(
    makespan: float, windows: NDArray[np.int64], order: NDArray[np.int64],
    head: NDArray[np.int64], is_reversed: NDArray[np.bool_], joint: JointOrder, visits: Visits,
    fleet: Fleet, units: Units, heads: TeamState, marks: Marks,
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
