"""Heights of the travels of one head in a joint plan, on bare arrays.

Each head keeps its own height field of what may be printed by then: its own
contours so far and, of every other head, all that is not ordered later.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.compiled import kernel
from decmcts.feasibility.clearance_kernels import Centrelines, PackedHead
from decmcts.feasibility.travel_kernels import HeightField, deposit, travel_height_above
from decmcts.team.engine.joint_kernels import UNIT_ASIDE, UNIT_PRINT


class Bends(NamedTuple):
    """Where travels bend, seen from above."""

    points: NDArray[np.float64]  # (b, 2)
    offsets: NDArray[np.int64]  # (m + 1,) of each unit; printing ones have none


class RoutedUnits(NamedTuple):
    """Units of the joint plan, see decmcts.team.engine.order.UnitOrder."""

    kind: NDArray[np.int8]  # (m,)
    contour: NDArray[np.int32]  # (m,)
    rows: NDArray[np.int64]  # (heads, most)
    counts: NDArray[np.int64]  # (heads,)
    later: NDArray[np.int64]  # (m, heads)


@kernel
def deposit_until(
    s: int, first: int, last: int, units: RoutedUnits, beads: Centrelines, field: HeightField
) -> None:
    """Add what head s prints in its units first..last - 1 to the field, in place."""
    for k in range(first, last):
        c = units.contour[units.rows[s, k]]
        if c >= 0:
            deposit(field, beads.points, beads.offsets[c], beads.offsets[c + 1], beads.radius[c])


@kernel
def travel_levels(
    r: int,
    units: RoutedUnits,
    starts: NDArray[np.float64],
    goals: NDArray[np.float64],
    bends: Bends,
    beads: Centrelines,
    field: HeightField,
    head: PackedHead,
    lift_mm: float,
    level: NDArray[np.float64],
) -> None:
    """Write to `level` (m,) the z at which each travel of head r crosses.

    `starts` and `goals` (m, 3) are where units begin and end. After a yield the
    head rests at the level it crossed at: that goal and the next start are
    changed in place. The field is filled in place.
    """
    seen = np.zeros(len(units.counts), np.int64)
    for i in range(units.counts[r]):
        row = units.rows[r, i]
        if units.kind[row] == UNIT_PRINT:
            continue
        for s in range(len(seen)):
            last = i if s == r else units.later[row, s]
            deposit_until(s, seen[s], last, units, beads, field)
            seen[s] = max(seen[s], last)
        stays_up = units.kind[row] == UNIT_ASIDE
        level[row] = crossing(
            starts[row], goals[row], bends.points[bends.offsets[row] : bends.offsets[row + 1]],
            stays_up, field, head, lift_mm,
        )  # fmt: skip
        if stays_up:
            goals[row, 2] = level[row]
            starts[units.rows[r, i + 1], 2] = level[row]


@kernel
def crossing(
    p: NDArray[np.float64],
    q: NDArray[np.float64],
    bends: NDArray[np.float64],
    stays_up: bool,
    field: HeightField,
    head: PackedHead,
    lift_mm: float,
) -> float:
    """Height of a travel from p by `bends` (b, 2) to q; `stays_up`: it need not come down to q."""
    z = p[2] if stays_up else max(p[2], q[2])
    if p[0] != q[0] or p[1] != q[1]:
        safe, x, y = z, p[0], p[1]
        for b in range(len(bends)):
            safe = travel_height_above(field, head, x, y, bends[b, 0], bends[b, 1], safe)
            x, y = bends[b, 0], bends[b, 1]
        safe = travel_height_above(field, head, x, y, q[0], q[1], safe)
        if safe > z:
            z = safe + lift_mm
    level: float = z
    return level
