"""Who waits for whom in a joint order, and when everything begins, on bare arrays.

Units are rows in the order they were put, which every wait agrees with: a unit waits
only for rows above its own. Of each other head only the latest wait is kept; earlier
ones are implied by that head's own sequence.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel
from decmcts._kernels.joint import NONE, Units, Visits, passed
from decmcts._kernels.rooms import Fleet, join_rooms, keep_room, room_at, too_near

CHUNK = 64  # units whose rooms are also kept joined, so that most can be passed over at once
AT_END = -1


@kernel
def latest_in_the_way(
    row: int,
    s: int,
    lowest: int,
    count: int,
    rows: NDArray[np.int64],
    joined: NDArray[np.float64],
    fleet: Fleet,
    units: Units,
) -> int:
    """Index of the last of head s's units so far in the way of a unit; `lowest` - 1: none is.

    `rows` are the units of head s and `joined` (chunks, 6) their rooms, joined by CHUNK.
    """
    r, k = units.head[row], count - 1
    while k >= lowest:
        chunk = k // CHUNK
        if not too_near(room_at(units.room, row), room_at(joined, chunk), r, s, fleet):
            k = chunk * CHUNK - 1
            continue
        first = max(lowest, chunk * CHUNK)
        while k >= first:
            if too_near(room_at(units.room, row), room_at(units.room, rows[k]), r, s, fleet):
                return k
            k -= 1
    return lowest - 1


@kernel
def latest_pred(
    row: int, s: int, own: NDArray[np.int64], place: NDArray[np.int64], visits: Visits, units: Units
) -> int:
    """Index within head s of the last unit that prints what this one rests on; NONE: none does."""
    contour, last = units.contour[row], NONE
    if contour != NONE:
        for k in range(visits.pred_offsets[contour], visits.pred_offsets[contour + 1]):
            unit = place[visits.preds[k]]
            if units.head[unit] == s:
                last = max(last, own[unit])
    return last


@kernel
def need_of(
    row: int,
    s: int,
    known: NDArray[np.int64],
    count: int,
    rows: NDArray[np.int64],
    joined: NDArray[np.float64],
    own: NDArray[np.int64],
    place: NDArray[np.int64],
    visits: Visits,
    fleet: Fleet,
    units: Units,
) -> tuple[int, int]:
    """Return what a unit needs of head s: a unit and a point of it, or AT_END; NONE: nothing.

    `known` is what its own head waited for before: unit and point.
    """
    unit, point = NONE, AT_END
    lowest = known[0] if known[1] != AT_END else known[0] + 1
    k = latest_in_the_way(row, s, max(lowest, 0), count, rows, joined, fleet, units)
    if k >= max(lowest, 0):
        piece = passed(rows[k], room_at(units.room, row), units.head[row], visits, fleet, units)
        unit, point = k, AT_END if piece == NONE else visits.pieces.point[piece]
    pred = latest_pred(row, s, own, place, visits, units)
    if pred >= unit and pred != NONE:
        unit, point = pred, AT_END
    if unit < known[0] or (unit == known[0] and known[1] == AT_END):
        return NONE, AT_END
    if unit == known[0] and point != AT_END and point <= known[1]:
        return NONE, AT_END
    return unit, point


@kernel
def find_waits(
    own: NDArray[np.int64], place: NDArray[np.int64], visits: Visits, fleet: Fleet, units: Units
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """For each unit and each other head: the unit of it to wait for, and the point, (m, heads).

    NONE where a unit needs nothing beyond what its own head waited for before. `own`
    (m,) is each unit's index within its head, `place` (n,) the unit that prints each contour.
    """
    m, heads = len(own), len(fleet.parks)
    after, point = np.full((m, heads), NONE), np.full((m, heads), AT_END, np.int32)
    known = np.full((heads, heads, 2), NONE)
    rows, counts = np.empty((heads, m), np.int64), np.zeros(heads, np.int64)
    joined = np.empty((heads, m // CHUNK + 1, 6))
    for row in range(m):
        r = units.head[row]
        for s in range(heads):
            if s == r:
                continue
            unit, at = need_of(
                row, s, known[r, s], counts[s], rows[s], joined[s], own, place, visits, fleet, units
            )
            if unit != NONE:
                after[row, s], point[row, s] = unit, at
                known[r, s, 0], known[r, s, 1] = unit, at
        chunk = counts[r] // CHUNK
        room = room_at(units.room, row)
        if counts[r] % CHUNK > 0:
            room = join_rooms(room_at(joined[r], chunk), room)
        keep_room(room, joined[r], chunk)
        rows[r, counts[r]] = row
        counts[r] += 1
    return after, point


@kernel
def first_later(
    head: NDArray[np.int32],
    own: NDArray[np.int64],
    rows: NDArray[np.int64],
    after: NDArray[np.int64],
    point: NDArray[np.int32],
    counts: NDArray[np.int64],
) -> NDArray[np.int64]:
    """For each unit and each head: the first unit of that head ordered after its end, (m, heads).

    That head's number of units where there is none. `rows[s, k]` is the row of
    head s's k-th unit. The values never fall along a head's sequence. A unit that waits
    for a point comes after the end of the unit before.
    """
    m, heads = after.shape
    later = np.empty((m, heads), np.int64)
    for row in range(m):
        later[row] = counts
    for row in range(m - 1, -1, -1):
        r = head[row]
        for s in range(heads):
            before = own[row] - 1 if s == r else after[row, s]
            if s != r and before != NONE and point[row, s] != AT_END:
                before -= 1
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
    passing: NDArray[np.float64],
    seconds: NDArray[np.float64],
) -> NDArray[np.float64]:
    """When each unit begins if all begin as early as their waits allow, (m,).

    `passing` (m, heads): seconds from the begin of what is waited for until it is passed.
    """
    begin = np.zeros(len(seconds))
    for row in range(len(seconds)):
        if own[row] > 0:
            before = rows[head[row], own[row] - 1]
            begin[row] = begin[before] + seconds[before]
        for s in range(after.shape[1]):
            if after[row, s] != NONE:
                waited = rows[s, after[row, s]]
                begin[row] = max(begin[row], begin[waited] + passing[row, s])
    return begin
