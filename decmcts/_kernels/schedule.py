"""Who acts when: the event-driven replay of one sequence per head, on bare arrays.

A *unit* is one action: a travel, the print of one contour, or a retreat. Its
box is the bounding box of its whole path, starting point included. A head sets
off to a contour only while the boxes of travel and print are both clear of the
room every other head holds: the boxes of what it is about, or the point it
rests at. The room of the travel is given back on arrival. So conflicting units
never overlap in nominal time and `after` edges only have to fix the order in
which they were begun (rule J3 of ARCHITECTURE.md).

When nothing runs and nothing can begin, the head with most work left gets its
way and those resting in its way retreat: on a rail outwards as far as needed,
else to their park. Retreats move away from everyone, so this never deadlocks.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.conflict import conflicts
from decmcts._kernels.jit import kernel
from decmcts._kernels.motion import trapezoid_time

NONE = -1
UNIT_PRINT, UNIT_TRAVEL, UNIT_YIELD, UNIT_PARK = 0, 1, 2, 3
NOT_YET = np.inf
OK, STUCK = 0, 1


class Visits(NamedTuple):
    """What the kernel knows of the contours as they will be visited."""

    first: NDArray[np.float64]  # (n, 3) entry point, mm
    last: NDArray[np.float64]  # (n, 3) exit point, mm
    boxes: NDArray[np.float64]  # (n, 4)
    seconds: NDArray[np.float64]  # (n,) printing time
    pred_offsets: NDArray[np.int64]  # (n + 1,)
    preds: NDArray[np.int32]


class Queues(NamedTuple):
    """One sequence per head."""

    order: NDArray[np.int32]  # (n,) contours, head after head
    offsets: NDArray[np.int64]  # (heads + 1,)
    turns: NDArray[np.int64]  # (n,) planned order of beginning over all heads; all 0: none


class Floor(NamedTuple):
    """The machine as the kernel sees it."""

    gaps: NDArray[np.float64]  # (heads, heads, 4)
    parks: NDArray[np.float64]  # (heads, 3)
    travel: NDArray[
        np.float64
    ]  # (6,) feed, acceleration, z feed, z acceleration, retraction s, min mm


class State(NamedTuple):
    """Where every head is; all arrays are written as time goes on."""

    position: NDArray[np.int64]  # (heads,) next entry of its sequence
    rest: NDArray[np.float64]  # (heads, 3) where it stands or will stand
    box: NDArray[np.float64]  # (heads, 4) room it holds now
    works: NDArray[np.float64]  # (heads, 4) room it holds from `arrive` on
    arrive: NDArray[np.float64]  # (heads,) end of the running travel; NOT_YET: none
    until: NDArray[np.float64]  # (heads,) when it will be idle; NOT_YET: it is
    left: NDArray[np.float64]  # (heads,) seconds of printing left
    ended: NDArray[np.float64]  # (n,) end of each contour; NOT_YET: not ended


class Units(NamedTuple):
    """Units in the order they were decided; rows from `used[0]` on are unused."""

    head: NDArray[np.int32]  # (m,)
    kind: NDArray[np.int8]  # (m,)
    contour: NDArray[np.int32]  # (m,) NONE unless printed
    target: NDArray[np.float64]  # (m, 3) where it ends
    box: NDArray[np.float64]  # (m, 4)
    begin: NDArray[np.float64]  # (m,)
    end: NDArray[np.float64]  # (m,)
    used: NDArray[np.int64]  # (1,)


@kernel
def travel_seconds(
    p: NDArray[np.float64], q: NDArray[np.float64], travel: NDArray[np.float64]
) -> float:
    """Estimate of a travel from p to q: level move, height difference, retraction."""
    flat = np.sqrt((q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2)
    rise = abs(q[2] - p[2])
    seconds = 0.0
    if flat > 0.0:
        seconds += trapezoid_time(flat, 0.0, 0.0, travel[0], travel[1])
    if rise > 0.0:
        seconds += trapezoid_time(rise, 0.0, 0.0, travel[2], travel[3])
    if flat >= travel[5]:
        seconds += travel[4]
    return seconds


@kernel
def unit_box(rest: NDArray[np.float64], box: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """Write to `out` the hull of a box and the point a head comes from."""
    out[0], out[1] = min(box[0], rest[0]), max(box[1], rest[0])
    out[2], out[3] = min(box[2], rest[1]), max(box[3], rest[1])


@kernel
def point_box(point: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """Write to `out` the box of one point."""
    out[0] = out[1] = point[0]
    out[2] = out[3] = point[1]


@kernel
def is_clear(r: int, box: NDArray[np.float64], state: State, floor: Floor) -> bool:
    """Whether head r may take `box` now."""
    for s in range(len(state.position)):
        if s != r and conflicts(box, state.box[s], floor.gaps[r, s]):
            return False
    return True


@kernel
def is_ready(contour: int, now: float, visits: Visits, state: State) -> bool:
    """Whether everything the contour rests on has been printed by `now`."""
    for k in range(visits.pred_offsets[contour], visits.pred_offsets[contour + 1]):
        if state.ended[visits.preds[k]] > now:
            return False
    return True


@kernel
def record(
    r: int,
    kind: int,
    contour: int,
    begin: float,
    end: float,
    box: NDArray[np.float64],
    target: NDArray[np.float64],
    units: Units,
) -> None:
    """Append a unit (mutates units)."""
    row = units.used[0]
    units.used[0] += 1
    units.head[row], units.kind[row], units.contour[row] = r, kind, contour
    units.box[row], units.target[row] = box, target
    units.begin[row], units.end[row] = begin, end


@kernel
def begin_print(
    r: int,
    contour: int,
    now: float,
    first: NDArray[np.float64],
    last: NDArray[np.float64],
    visits: Visits,
    floor: Floor,
    state: State,
    units: Units,
) -> None:
    """Send head r to print a contour from `first` to `last` (mutates state and units)."""
    box = np.empty(4)
    travel = travel_seconds(state.rest[r], first, floor.travel)
    if np.any(state.rest[r] != first):
        point_box(first, box)
        unit_box(state.rest[r], box, box)
        record(r, UNIT_TRAVEL, NONE, now, now + travel, box, first, units)
        state.arrive[r] = now + travel
    unit_box(state.rest[r], visits.boxes[contour], state.box[r])
    state.works[r] = visits.boxes[contour]
    end = now + travel + visits.seconds[contour]
    record(r, UNIT_PRINT, contour, now + travel, end, visits.boxes[contour], last, units)
    state.rest[r] = last
    state.until[r] = state.ended[contour] = end
    state.left[r] -= visits.seconds[contour]


@kernel
def can_print(r: int, contour: int, now: float, visits: Visits, floor: Floor, state: State) -> bool:
    """Whether head r may set off to a contour: it is ready and the way is clear."""
    if not is_ready(contour, now, visits, state):
        return False
    box = np.empty(4)
    unit_box(state.rest[r], visits.boxes[contour], box)
    return is_clear(r, box, state, floor)


@kernel
def try_retreat(
    r: int,
    kind: int,
    target: NDArray[np.float64],
    now: float,
    floor: Floor,
    state: State,
    units: Units,
) -> bool:
    """Begin a retreat of head r if the way is clear."""
    box = np.empty(4)
    point_box(target, box)
    unit_box(state.rest[r], box, box)
    if not is_clear(r, box, state, floor):
        return False
    end = now + travel_seconds(state.rest[r], target, floor.travel)
    record(r, kind, NONE, now, end, box, target, units)
    state.box[r], state.rest[r], state.until[r] = box, target, end
    return True


@kernel
def end_next(state: State) -> float:
    """Advance to the next arrival or end of a unit. Returns the time."""
    soon: float = min(state.until.min(), state.arrive.min())
    for r in range(len(state.until)):
        if state.arrive[r] <= soon:
            state.arrive[r] = NOT_YET
            state.box[r] = state.works[r]
        if state.until[r] <= soon:
            state.until[r] = NOT_YET
            point_box(state.rest[r], state.box[r])
    return soon


@kernel
def start_state(visits: Visits, floor: Floor, work: NDArray[np.float64]) -> State:
    """All heads parked, nothing printed; `work` is each head's printing time."""
    heads = len(floor.parks)
    box = np.empty((heads, 4))
    for r in range(heads):
        point_box(floor.parks[r], box[r])
    return State(
        np.zeros(heads, np.int64),
        floor.parks.copy(),
        box,
        box.copy(),
        np.full(heads, NOT_YET),
        np.full(heads, NOT_YET),
        work.copy(),
        np.full(len(visits.seconds), NOT_YET),
    )


@kernel
def new_units(most: int) -> Units:
    """Room for `most` units."""
    return Units(
        np.empty(most, np.int32),
        np.empty(most, np.int8),
        np.empty(most, np.int32),
        np.empty((most, 3)),
        np.empty((most, 4)),
        np.empty(most),
        np.empty(most),
        np.zeros(1, np.int64),
    )


@kernel
def by_work_left(state: State) -> NDArray[np.int64]:
    """Heads, the one with most printing left first; ties by number."""
    return np.argsort(-state.left, kind="mergesort")


@kernel
def yield_target(
    s: int,
    r: int,
    wanted: NDArray[np.float64],
    floor: Floor,
    state: State,
    out: NDArray[np.float64],
) -> int:
    """Write to `out` where head s goes to let head r have the box `wanted`; returns the kind.

    On a rail: straight outwards, just far enough; elsewhere: to the park.
    """
    out[:] = state.rest[s]
    gap = floor.gaps[s, r]
    if np.isfinite(gap).sum() != 1:
        out[:] = floor.parks[s]
        return UNIT_PARK
    for axis in range(2):
        park = floor.parks[s, axis]
        if np.isfinite(gap[2 * axis]):
            out[axis] = min(out[axis], max(wanted[2 * axis] - gap[2 * axis], park))
        if np.isfinite(gap[2 * axis + 1]):
            out[axis] = max(out[axis], min(wanted[2 * axis + 1] + gap[2 * axis + 1], park))
    return UNIT_YIELD


@kernel
def make_way(
    r: int, wanted: NDArray[np.float64], now: float, floor: Floor, state: State, units: Units
) -> bool:
    """Send every idle head that rests in the way of `wanted` aside; whether one went."""
    went = False
    target = np.empty(3)
    for s in range(len(state.position)):
        if s == r or state.until[s] < NOT_YET:
            continue
        if conflicts(wanted, state.box[s], floor.gaps[r, s]):
            kind = yield_target(s, r, wanted, floor, state, target)
            went = try_retreat(s, kind, target, now, floor, state, units) or went
    return went


@kernel
def at_park(r: int, floor: Floor, state: State) -> bool:
    """Whether head r stands at its park."""
    return bool(np.all(state.rest[r] == floor.parks[r]))


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


@kernel
def latest_conflict(
    row: int, other: int, lowest: int, rows: NDArray[np.int64], units: Units, floor: Floor
) -> int:
    """Index (in `rows`, units of head `other`) of the last unit in conflict with `row`.

    Only units after `lowest` that began before `row`; else `lowest`.
    """
    gap = floor.gaps[units.head[row], other]
    for k in range(len(rows) - 1, lowest, -1):
        if conflicts(units.box[row], units.box[rows[k]], gap):
            return k
    return lowest


@kernel
def after_edges(
    units: Units, own: NDArray[np.int64], place: NDArray[np.int64], visits: Visits, floor: Floor
) -> NDArray[np.int64]:
    """For each unit and each head: the last unit of that head that must have ended, (m, heads).

    NONE where a unit needs none beyond what its own head waited for before.
    `own` (m,) is each unit's index within its head, `place` (n,) the unit that
    prints each contour. Of a head's units only the latest is kept: earlier
    ones are implied by that head's own sequence.
    """
    m, heads = len(own), len(floor.parks)
    after = np.full((m, heads), NONE)
    known = np.full((heads, heads), NONE)
    rows = np.empty((heads, m), np.int64)
    counts = np.zeros(heads, np.int64)
    for row in range(m):
        r = units.head[row]
        for s in range(heads):
            if s == r:
                continue
            need = latest_conflict(row, s, known[r, s], rows[s, : counts[s]], units, floor)
            need = max(need, latest_pred(row, s, own, place, visits, units))
            if need > known[r, s]:
                after[row, s] = known[r, s] = need
        rows[r, counts[r]] = row
        counts[r] += 1
    return after


@kernel
def latest_pred(
    row: int,
    other: int,
    own: NDArray[np.int64],
    place: NDArray[np.int64],
    visits: Visits,
    units: Units,
) -> int:
    """Index within head `other` of the last unit that prints a predecessor; NONE if none does."""
    contour = units.contour[row]
    last = NONE
    if contour >= 0:
        for k in range(visits.pred_offsets[contour], visits.pred_offsets[contour + 1]):
            unit = place[visits.preds[k]]
            if units.head[unit] == other:
                last = max(last, own[unit])
    return last


@kernel
def first_later(
    units: Units,
    own: NDArray[np.int64],
    rows: NDArray[np.int64],
    after: NDArray[np.int64],
    counts: NDArray[np.int64],
) -> NDArray[np.int64]:
    """For each unit and each head: the first unit of that head ordered after it, (m, heads).

    That head's number of units where there is none. `rows[s, k]` is the row of
    head s's k-th unit. The values never fall along a head's sequence.
    """
    m, heads = after.shape
    later = np.empty((m, heads), np.int64)
    for row in range(m):
        later[row] = counts
    for row in range(m - 1, -1, -1):
        r = units.head[row]
        for s in range(heads):
            before = own[row] - 1 if s == r else after[row, s]
            if before == NONE:
                continue
            up = rows[s, before]
            later[up] = np.minimum(later[up], later[row])
            later[up, r] = min(later[up, r], own[row])
    return later


@kernel
def earliest(
    head: NDArray[np.int32],
    own: NDArray[np.int64],
    rows: NDArray[np.int64],
    after: NDArray[np.int64],
    seconds: NDArray[np.float64],
) -> NDArray[np.float64]:
    """When each unit begins if all begin as early as the partial order allows, (m,)."""
    begin = np.zeros(len(seconds))
    for row in range(len(seconds)):
        if own[row] > 0:
            before = rows[head[row], own[row] - 1]
            begin[row] = begin[before] + seconds[before]
        for s in range(after.shape[1]):
            if after[row, s] != NONE:
                before = rows[s, after[row, s]]
                begin[row] = max(begin[row], begin[before] + seconds[before])
    return begin
