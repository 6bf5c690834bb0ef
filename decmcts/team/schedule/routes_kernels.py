"""Heights of the travels of one head in a joint plan, on bare arrays.

Each head keeps its own height field of what may be printed by then: its own
contours so far and, of every other head, all that is not ordered later.

The field gives the lowest safe z of a straight travel over what is printed. Cell values are tops of
beads, widened by their radius (clearance + half the width). A cell that a widened bead touches
takes the bead's top and a query takes every cell its swept slice touches, so a query is never lower
than the definition "Blocked" in docs/definitions.md and at most about a cell's diagonal too
careful. Above the cells stands a pyramid of maxima, FANOUT x FANOUT cells a step, so that a query
opens only what can still raise its answer.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from decmcts.arrays import Floats, Ints
from decmcts.compiled import kernel
from decmcts.feasibility.clearance_kernels import Z_EPS, Centrelines, PackedHead, point_segment2
from decmcts.team.engine.joint_kernels import UNIT_ASIDE, UNIT_PRINT
from decmcts.team.engine.waits_kernels import UnitOrder

FANOUT = 4
EMPTY = -np.inf
STACK = 512  # deep enough: at most 15 siblings stay open on each of the levels


class HeightField(NamedTuple):
    """Highest printed z by XY cell, with its pyramid; `deposit` changes it in place."""

    top: Floats  # (all cells of all levels,) mm, EMPTY where nothing is
    offsets: Ints  # (n_levels,) first cell of each level, 0 is the finest
    shape: Ints  # (n_levels, 2) columns (x), rows (y)
    origin: Floats  # (2,) lower corner, mm
    cell: Floats  # (n_levels,) cell size, mm


@kernel
def raise_cell(field: HeightField, column: int, row: int, z: float) -> None:
    """Raise a finest cell and its pyramid to at least z, in place."""
    for level in range(len(field.cell)):
        at = field.offsets[level] + row * field.shape[level, 0] + column
        if field.top[at] >= z:
            return
        field.top[at] = z
        column //= FANOUT
        row //= FANOUT


@kernel
def cell_range(field: HeightField, axis: int, low: float, high: float) -> tuple[int, int]:
    """Return the finest cells [first, last) that low..high touches, cut to the field."""
    first = int(np.floor((low - field.origin[axis]) / field.cell[0]))
    last = int(np.floor((high - field.origin[axis]) / field.cell[0])) + 1
    return max(first, 0), min(last, field.shape[0, axis])


@kernel
def deposit_segment(
    field: HeightField, ax: float, ay: float, bx: float, by: float, z: float, radius: float
) -> None:
    """Raise the cells that a segment widened by `radius` touches, row by row, in place."""
    reach = radius + field.cell[0] * 0.7072
    row_first, row_last = cell_range(field, 1, min(ay, by) - radius, max(ay, by) + radius)
    slope = (bx - ax) / (by - ay) if by != ay else 0.0
    for row in range(row_first, row_last):
        y = field.origin[1] + (row + 0.5) * field.cell[0]
        low, high = min(ax, bx), max(ax, bx)
        if slope != 0.0:
            half = (reach + field.cell[0]) * abs(slope)
            middle = ax + (y - ay) * slope
            low, high = max(low, middle - half), min(high, middle + half)
        first, last = cell_range(field, 0, low - radius, high + radius)
        for column in range(first, last):
            x = field.origin[0] + (column + 0.5) * field.cell[0]
            at = row * field.shape[0, 0] + column
            if field.top[at] < z and point_segment2(x, y, ax, ay, bx, by) <= reach * reach:
                raise_cell(field, column, row, z)


@kernel
def deposit(field: HeightField, points: Floats, first: int, last: int, radius: float) -> None:
    """Add the beads along points[first:last], widened by `radius`, in place."""
    for i in range(first, last - 1):
        z = max(points[i, 2], points[i + 1, 2])
        deposit_segment(
            field, points[i, 0], points[i, 1], points[i + 1, 0], points[i + 1, 1], z, radius
        )


@kernel
def touches_sweep(
    field: HeightField,
    level: int,
    column: int,
    row: int,
    head: PackedHead,
    k: int,
    move: Floats,
) -> bool:
    """Tell whether a cell touches polygon k swept along the move (x0, y0, x1, y1)."""
    cell = field.cell[level]
    x = field.origin[0] + column * cell
    y = field.origin[1] + row * cell
    box = head.boxes[k]
    if (
        x > max(move[0], move[2]) + box[2]
        or x + cell < min(move[0], move[2]) + box[0]
        or y > max(move[1], move[3]) + box[3]
        or y + cell < min(move[1], move[3]) + box[1]
    ):
        return False
    for e in range(head.offsets[k], head.offsets[k + 1]):
        nx, ny = head.normals[e, 0], head.normals[e, 1]
        far = max(nx * move[0] + ny * move[1], nx * move[2] + ny * move[3]) + head.levels[e]
        if nx * (x if nx > 0.0 else x + cell) + ny * (y if ny > 0.0 else y + cell) > far:
            return False
    return beside_sweep(x, y, cell, head, k, move)


@kernel
def beside_sweep(x: float, y: float, cell: float, head: PackedHead, k: int, move: Floats) -> bool:
    """Tell whether the move's own two long sides leave the cell within the sweep."""
    nx = move[1] - move[3]
    ny = move[2] - move[0]
    low = np.inf
    high = -np.inf
    for v in range(head.offsets[k], head.offsets[k + 1]):
        value = nx * head.vertices[v, 0] + ny * head.vertices[v, 1]
        low = min(low, value)
        high = max(high, value)
    along = nx * move[0] + ny * move[1]
    corner_low = nx * (x if nx > 0.0 else x + cell) + ny * (y if ny > 0.0 else y + cell)
    corner_high = nx * (x + cell if nx > 0.0 else x) + ny * (y + cell if ny > 0.0 else y)
    return bool(corner_low <= along + high and corner_high >= along + low)


@kernel
def push_children(
    field: HeightField,
    stack: Ints,
    size: int,
    level: int,
    column: int,
    row: int,
) -> int:
    """Put the children of a cell on the stack; returns its new size."""
    for y in range(row * FANOUT, min((row + 1) * FANOUT, field.shape[level - 1, 1])):
        for x in range(column * FANOUT, min((column + 1) * FANOUT, field.shape[level - 1, 0])):
            stack[size, 0] = level - 1
            stack[size, 1] = x
            stack[size, 2] = y
            size += 1
    return size


@kernel
def highest_under(
    field: HeightField,
    head: PackedHead,
    k: int,
    move: Floats,
    floor: float,
    stack: Ints,
) -> float:
    """Return the highest cell that polygon k sweeps, or `floor` if none is above it."""
    stack[0, 0] = len(field.cell) - 1
    stack[0, 1] = 0
    stack[0, 2] = 0
    size = 1
    while size > 0:
        size -= 1
        level, column, row = stack[size, 0], stack[size, 1], stack[size, 2]
        top = field.top[field.offsets[level] + row * field.shape[level, 0] + column]
        if top <= floor or not touches_sweep(field, level, column, row, head, k, move):
            continue
        if level == 0:
            floor = top
        else:
            size = push_children(field, stack, size, level, column, row)
    return floor


@kernel
def travel_height_above(
    field: HeightField,
    head: PackedHead,
    x0: float,
    y0: float,
    x1: float,
    y1: float,
    z: float,
) -> float:
    """Return the lowest nozzle z, at least `z`, at which the straight move is safe.

    With `z` EMPTY that is -inf where nothing is in the way. The higher `z`, the fewer cells
    are opened.
    """
    summit = field.top[field.offsets[-1]]
    move = np.array([x0, y0, x1, y1])
    stack = np.empty((STACK, 3), np.int64)
    for k in range(len(head.heights)):
        if summit <= z + head.heights[k] + Z_EPS:
            break
        floor = z + head.heights[k] + Z_EPS
        found = highest_under(field, head, k, move, floor, stack)
        if found > floor:
            z = found - head.heights[k]
    return z


class Bends(NamedTuple):
    """Where travels bend, seen from above."""

    points: Floats  # (b, 2)
    offsets: Ints  # (m + 1,) of each unit; printing ones have none


@kernel
def deposit_until(
    s: int, first: int, last: int, units: UnitOrder, beads: Centrelines, field: HeightField
) -> None:
    """Add what head s prints in its units first..last - 1 to the field, in place."""
    for k in range(first, last):
        c = units.contour[units.rows[s, k]]
        if c >= 0:
            deposit(field, beads.points, beads.offsets[c], beads.offsets[c + 1], beads.radius[c])


@kernel
def travel_levels(
    r: int,
    units: UnitOrder,
    starts: Floats,
    goals: Floats,
    bends: Bends,
    beads: Centrelines,
    field: HeightField,
    head: PackedHead,
    lift_mm: float,
    level: Floats,
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
    p: Floats,
    q: Floats,
    bends: Floats,
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
