"""The partial order that a replay implies: waits, what comes later, earliest times.

Units are rows in the order they begin in nominal time; conflicting ones never
overlap there, so their order of beginning is the order to keep.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.conflict import conflicts
from decmcts._kernels.jit import kernel
from decmcts._kernels.units import NONE, Floor, Units, Visits


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
