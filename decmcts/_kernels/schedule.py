"""Who acts when: the event-driven replay of one sequence per head, on bare arrays.

When nothing runs and nothing can begin, the head whose turn is first (or with
most work left) gets its way and those resting in its way retreat: on a rail
outwards as far as needed, else to their park. Retreats on a rail move away
from everyone, so this never deadlocks there.
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
    is_ready,
    make_way,
    new_units,
    start_state,
    try_retreat,
    unit_box,
)


class Queues(NamedTuple):
    """One sequence per head."""

    order: NDArray[np.int32]  # (n,) contours, head after head
    offsets: NDArray[np.int64]  # (heads + 1,)
    turns: NDArray[np.int64]  # (n,) planned order of beginning over all heads; all 0: none


@kernel
def by_work_left(state: State) -> NDArray[np.int64]:
    """Heads, the one with most printing left first; ties by number."""
    return np.argsort(-state.left, kind="mergesort")


@kernel
def is_my_turn(
    r: int,
    box: NDArray[np.float64],
    turn: int,
    queues: Queues,
    visits: Visits,
    floor: Floor,
    state: State,
) -> bool:
    """Whether no other head has yet to begin a conflicting contour of an earlier turn."""
    for s in range(len(state.position)):
        at = queues.offsets[s] + state.position[s]
        while s != r and at < queues.offsets[s + 1] and queues.turns[at] < turn:
            if conflicts(box, visits.boxes[queues.order[at]], floor.gaps[r, s]):
                return False
            at += 1
    return True


@kernel
def begin_ready(
    queues: Queues, now: float, visits: Visits, floor: Floor, state: State, units: Units
) -> None:
    """Begin whatever the idle heads' sequences allow; heads that are through park."""
    box = np.empty(4)
    for r in by_work_left(state):
        if state.until[r] < NOT_YET:
            continue
        at = queues.offsets[r] + state.position[r]
        if at < queues.offsets[r + 1]:
            c = queues.order[at]
            unit_box(state.rest[r], visits.boxes[c], box)
            if not is_ready(c, now, visits, state) or not is_clear(r, box, state, floor):
                continue
            if is_my_turn(r, box, queues.turns[at], queues, visits, floor, state):
                begin_print(r, c, now, visits.first[c], visits.last[c], visits, floor, state, units)
                state.position[r] += 1
        elif not at_park(r, floor, state):
            try_retreat(r, UNIT_PARK, floor.parks[r], now, floor, state, units)


@kernel
def break_jam(
    queues: Queues, now: float, visits: Visits, floor: Floor, state: State, units: Units
) -> bool:
    """Let the ready head of the earliest turn have its way; False: no head can be helped."""
    tried = np.zeros(len(state.position), np.bool_)
    wanted = np.empty(4)
    for _ in range(len(tried)):
        first = NONE
        for r in by_work_left(state):
            at = queues.offsets[r] + state.position[r]
            if tried[r] or at >= queues.offsets[r + 1]:
                continue
            if not is_ready(queues.order[at], now, visits, state):
                continue
            if first == NONE or queues.turns[at] < queues.turns[place_of(first, queues, state)]:
                first = r
        if first == NONE:
            return False
        tried[first] = True
        c = queues.order[place_of(first, queues, state)]
        unit_box(state.rest[first], visits.boxes[c], wanted)
        if make_way(first, wanted, now, floor, state, units):
            return True
    return False


@kernel
def place_of(r: int, queues: Queues, state: State) -> int:
    """Place of head r's next contour in the queues."""
    place: int = queues.offsets[r] + state.position[r]
    return place


@kernel
def replay(queues: Queues, visits: Visits, floor: Floor, most: int) -> tuple[Units, int]:
    """Time the heads' queues.

    Returns the units in the order they were decided and OK, or STUCK when the
    queues contradict the precedence or a head can not get out of the way.
    """
    heads = len(floor.parks)
    work = np.zeros(heads)
    for r in range(heads):
        for at in range(queues.offsets[r], queues.offsets[r + 1]):
            work[r] += visits.seconds[queues.order[at]]
    state = start_state(visits, floor, work)
    units = new_units(most)
    now = 0.0
    while True:
        begin_ready(queues, now, visits, floor, state, units)
        if state.until.min() == NOT_YET:
            if is_through(queues.offsets, floor, state):
                return units, OK
            if units.used[0] + 3 * heads > most:
                return units, STUCK
            if not break_jam(queues, now, visits, floor, state, units):
                return units, STUCK
        now = end_next(state)


@kernel
def is_through(offsets: NDArray[np.int64], floor: Floor, state: State) -> bool:
    """Whether every sequence is printed and every head is parked."""
    for r in range(len(state.position)):
        if offsets[r] + state.position[r] < offsets[r + 1] or not at_park(r, floor, state):
            return False
    return True
