"""What heads do, unit by unit, on bare arrays: the state of a replay and its moves.

A *unit* is one action: a travel, the print of one contour, or a retreat. Its
box is the bounding box of its whole path, starting point included. A head sets
off to a contour only while the boxes of travel and print are both clear of the
room every other head holds: the boxes of what it is about, or the point it
rests at. The room of the travel is given back on arrival. So conflicting units
never overlap in nominal time and `after` edges only have to fix the order in
which they were begun (rule J3 of ARCHITECTURE.md).

Who begins what is decided elsewhere: `replay` follows given sequences
(`decmcts._kernels.schedule`), `dispatch` chooses (`decmcts._kernels.dispatch`).
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
