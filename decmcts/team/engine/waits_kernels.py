"""Who waits for whom in a joint order, and when everything begins, on bare arrays.

Units are rows in the order they were placed, which every wait agrees with: a unit waits
only for rows above its own. Of each other head only the latest wait is kept; earlier
ones are implied by that head's own sequence.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.compiled import kernel
from decmcts.print.lags_kernels import Lags
from decmcts.team.engine.joint_kernels import NONE, UNIT_PRINT, Units, Visits, first_clear_piece
from decmcts.team.engine.spaces_kernels import Fleet, join_spaces, keep_space, space_at, too_near

CHUNK = 64  # units whose spaces are also kept joined, so that most can be passed over at once
AT_END = -1


class Waits(NamedTuple):
    """What units wait for, and how units of one head follow one another."""

    own: Ints  # (m,) index within the head's units
    place: Ints  # (n,) unit that prints each contour
    rows: Ints  # (heads, m) row of each head's k-th unit
    counts: Ints  # (heads,) units of each head
    after: Ints  # (m, heads) that head's unit to wait for; NONE
    point: Int32s  # (m, heads) vertex of it that must be passed; AT_END


@kernel
def latest_in_the_way(
    row: int, s: int, lowest: int, joined: Floats, waits: Waits, fleet: Fleet, units: Units,
) -> int:  # fmt: skip
    """Index of the last of head s's units so far in the way of a unit; `lowest` - 1: none is.

    `joined` (chunks, 6) are the reserved spaces of head s's units, joined by CHUNK.
    """
    r, rows = units.head[row], waits.rows[s]
    k: int = waits.counts[s] - 1
    while k >= lowest:
        chunk = k // CHUNK
        if not too_near(space_at(units.space, row), space_at(joined, chunk), r, s, fleet):
            k = chunk * CHUNK - 1
            continue
        first = max(lowest, chunk * CHUNK)
        while k >= first:
            if too_near(space_at(units.space, row), space_at(units.space, rows[k]), r, s, fleet):
                return k
            k -= 1
    return lowest - 1


@kernel
def latest_pred(row: int, s: int, waits: Waits, visits: Visits, units: Units) -> int:
    """Index within head s of the last unit that prints what supports this one; NONE: none does."""
    contour, last = units.contour[row], NONE
    if contour != NONE:
        for k in range(visits.pred_offsets[contour], visits.pred_offsets[contour + 1]):
            unit = waits.place[visits.preds[k]]
            if units.head[unit] == s:
                last = max(last, waits.own[unit])
    return last


@kernel
def need_of(
    row: int, s: int, known: Ints, joined: Floats, waits: Waits,
    visits: Visits, fleet: Fleet, units: Units,
) -> tuple[int, int]:  # fmt: skip
    """Return what a unit needs of head s: a unit and a point of it, or AT_END; NONE: nothing.

    `known` is what its own head waited for before: unit and point.
    """
    unit, point = NONE, AT_END
    lowest = known[0] if known[1] != AT_END else known[0] + 1
    k = latest_in_the_way(row, s, max(lowest, 0), joined, waits, fleet, units)
    if k >= max(lowest, 0):
        space, u = space_at(units.space, row), waits.rows[s, k]
        piece = first_clear_piece(u, space, units.head[row], visits, fleet, units)
        unit, point = k, AT_END if piece == NONE else visits.pieces.point[piece]
    pred = latest_pred(row, s, waits, visits, units)
    if pred >= unit and pred != NONE:
        unit, point = pred, AT_END
    if unit < known[0] or (unit == known[0] and known[1] == AT_END):
        return NONE, AT_END
    if unit == known[0] and point != AT_END and point <= known[1]:
        return NONE, AT_END
    return unit, point


@kernel
def find_waits(visits: Visits, fleet: Fleet, units: Units) -> Waits:
    """Find for each unit and each other head the unit of it to wait for, and the point.

    NONE where a unit needs nothing beyond what its own head waited for before.
    """
    m, heads = units.used[0], len(fleet.parks)
    waits = Waits(
        np.empty(m, np.int64), np.empty(len(visits.ends), np.int64),
        np.empty((heads, m), np.int64), np.zeros(heads, np.int64),
        np.full((m, heads), NONE), np.full((m, heads), AT_END, np.int32),
    )  # fmt: skip
    known = np.full((heads, heads, 2), NONE)
    joined = np.empty((heads, m // CHUNK + 1, 6))
    for row in range(m):
        r = units.head[row]
        for s in range(heads):
            if s == r:
                continue
            unit, at = need_of(row, s, known[r, s], joined[s], waits, visits, fleet, units)
            if unit != NONE:
                waits.after[row, s], waits.point[row, s] = unit, at
                known[r, s, 0], known[r, s, 1] = unit, at
        count = waits.counts[r]
        chunk = count // CHUNK
        space = space_at(units.space, row)
        if count % CHUNK > 0:
            space = join_spaces(space_at(joined[r], chunk), space)
        keep_space(space, joined[r], chunk)
        waits.own[row], waits.rows[r, count], waits.counts[r] = count, row, count + 1
        if units.contour[row] != NONE:
            waits.place[units.contour[row]] = row
    return waits


@kernel
def first_later(head: Int32s, waits: Waits) -> Ints:
    """For each unit and each head: the first unit of that head ordered after its end, (m, heads).

    That head's number of units where there is none. The values never fall along a head's
    sequence. A unit that waits for a point comes after the end of the unit before.
    """
    m, heads = waits.after.shape
    later = np.empty((m, heads), np.int64)
    for row in range(m):
        later[row] = waits.counts
    for row in range(m - 1, -1, -1):
        r = head[row]
        for s in range(heads):
            before = waits.own[row] - 1 if s == r else waits.after[row, s]
            if s != r and before != NONE and waits.point[row, s] != AT_END:
                before -= 1
            if before == NONE:
                continue
            up = waits.rows[s, before]
            later[up] = np.minimum(later[up], later[row])
            later[up, r] = min(later[up, r], waits.own[row])
    return later


class UnitOrder(NamedTuple):
    """Units of all heads in the order they were placed, with their waits."""

    head: Int32s  # (m,)
    kind: NDArray[np.int8]  # (m,) UNIT_PRINT, UNIT_TRAVEL, UNIT_ASIDE, UNIT_PARK
    contour: Int32s  # (m,) -1 unless printed
    target: Floats  # (m, 3) where it ends
    own: Ints  # as in `Waits`, to `point`
    place: Ints
    rows: Ints
    counts: Ints
    after: Ints
    point: Int32s
    later: Ints  # (m, heads) that head's first unit ordered after this one

    def of_head(self, r: int) -> Ints:
        """Return the rows of a head's units in its order."""
        return self.rows[r, : self.counts[r]]


class Rests(NamedTuple):
    """Where heads rest so that what is below can cool; written."""

    seconds: Floats  # (m,) rest before each unit
    begin: Floats  # (m,) when that rest begins
    row: Ints  # (k,) unit that waits for a cooling one before it
    other: Ints  # (k,) head and
    unit: Ints  # (k,) index within that head of the one that cools
    first: Flags  # (k,) before the unit's rest begins, not before the unit does
    used: Ints  # (1,) of these


@kernel
def last_below(c: int, s: int, units: UnitOrder, lags: Lags) -> tuple[int, float]:
    """Index within head s of the last unit that prints what lies below c, and its lag; or NONE."""
    last, lag = NONE, 0.0
    for e in range(lags.offsets[c], lags.offsets[c + 1]):
        row = units.place[lags.below[e]]
        if units.head[row] == s:
            last, lag = max(last, units.own[row]), max(lag, lags.seconds[e])
    return last, lag


@kernel
def known_since(row: int, s: int, last: int, sure: Ints, units: UnitOrder) -> int:
    """First unit of a row's head, before it, at whose begin unit `last` of s has surely ended."""
    own = units.rows[units.head[row]]
    low, high = 0, units.own[row]
    while low < high:
        middle = (low + high) // 2
        if sure[own[middle], s] > last:
            high = middle
        else:
            low = middle + 1
    return low


@kernel
def rest_for(
    row: int, s: int, last: int, lag: float, worked: float, least: float, begin: Floats,
    done: Floats, ended: float, sure: Ints, units: UnitOrder, rests: Rests,
) -> float:  # fmt: skip
    """How long a unit rests before it begins, `lag` after unit `last` of head s has ended.

    Only the work of its own head counts for sure: `worked` before this unit, `done` (m,)
    before the others. Where the other's end is not known early enough the head waits for it
    (mutates sure, rests) where that costs nothing in time.
    """
    own, at = units.rows[units.head[row]], units.own[row]
    known = known_since(row, s, last, sure, units)
    if known < at and lag - (worked - done[own[known]]) <= least:
        return 0.0
    j, passed_s = at, 0.0
    while j > 0 and passed_s < lag and begin[own[j - 1]] >= ended:
        j -= 1
        passed_s = worked - done[own[j]]
    if j == at and lag <= least:
        return 0.0
    k = rests.used[0]
    rests.row[k], rests.other[k], rests.unit[k] = own[j], s, last
    rests.first[k] = j == at
    rests.used[0] += 1
    for i in range(j, at + 1):
        sure[own[i], s] = max(sure[own[i], s], last + 1)
    if j == at:
        rests.begin[row] = max(rests.begin[row], ended)
    return lag - passed_s


@kernel
def let_cool(
    units: UnitOrder,
    passing: Floats,
    seconds: Floats,
    lags: Lags,
    least: float,
    step: float,
) -> tuple[Floats, Rests]:
    """When each unit begins if all begin as early as their waits allow, and rests for cooling.

    `passing` (m, heads): seconds from the begin of what is waited for until it is passed. Rests
    are multiples of `step`, longer than `least`.
    """
    m, heads = units.after.shape
    most = len(lags.below) + 1
    rests = Rests(
        np.zeros(m), np.zeros(m), np.empty(most, np.int64), np.empty(most, np.int64),
        np.empty(most, np.int64), np.empty(most, np.bool_), np.zeros(1, np.int64),
    )  # fmt: skip
    begin, done = np.zeros(m), np.zeros(m)  # done: work of the own head before each unit
    sure = np.zeros((m, heads), np.int64)  # units of each head that have ended by its begin
    for row in range(m):
        r, c, need = units.head[row], units.contour[row], 0.0
        worked, free = 0.0, 0.0
        if units.own[row] > 0:
            before = units.rows[r, units.own[row] - 1]
            free, worked = begin[before] + seconds[before], done[before] + seconds[before]
            sure[row] = sure[before]
        rests.begin[row] = free
        if units.kind[row] == UNIT_PRINT:
            for s in range(heads):
                last, lag = last_below(c, s, units, lags)
                if last == NONE:
                    continue
                other = units.rows[s, last]
                if s == r:
                    need = max(need, lag - (worked - done[other] - seconds[other]))
                    continue
                ended = begin[other] + seconds[other]
                need = max(need, rest_for(
                    row, s, last, lag, worked, least, begin, done, ended, sure, units, rests,
                ))  # fmt: skip
        if need > least:
            rests.seconds[row] = np.ceil(need / step) * step
        begin[row] = rests.begin[row] + rests.seconds[row]
        done[row] = worked + rests.seconds[row]
        for s in range(heads):
            if units.after[row, s] != NONE:
                waited = units.rows[s, units.after[row, s]]
                begin[row] = max(begin[row], begin[waited] + passing[row, s])
                whole = units.point[row, s] == AT_END
                sure[row, s] = max(sure[row, s], units.after[row, s] + (1 if whole else 0))
    return begin, rests
