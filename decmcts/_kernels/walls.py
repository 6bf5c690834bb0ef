"""Whether a straight travel stays inside the part: outer walls by layer, in a uniform grid.

Each layer's wall segments are listed by the cells they touch. A travel walks the
cells under it; no segment of these may cross it, but for walls its ends lie on.
Then it is inside or outside as a whole, which its middle tells by the even-odd rule.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel

END_MM = 0.05  # of a travel at both ends that may touch a wall: its ends may lie on one
SAME_Z_MM = 1e-6


class Walls(NamedTuple):
    """Outer walls of all layers; cell (i, j) of layer k is first[k] + j * size[k, 0] + i."""

    z: NDArray[np.float64]  # (layers,) ascending, mm
    origin: NDArray[np.float64]  # (layers, 2) lower corner of the layer's grid, mm
    size: NDArray[np.int64]  # (layers, 2) columns, rows
    first: NDArray[np.int64]  # (layers,) first cell
    starts: NDArray[np.int64]  # (cells + 1,) cell c lists listed[starts[c]:starts[c + 1]]
    listed: NDArray[np.int32]  # (m,) segments
    segments: NDArray[np.float64]  # (s, 4) x0, y0, x1, y1
    cell: float  # mm


@kernel
def layer_at(walls: Walls, z: float) -> int:
    """Return the layer whose walls lie at z, -1 for none."""
    low, high = 0, len(walls.z)
    while low < high:
        middle = (low + high) // 2
        if walls.z[middle] < z - SAME_Z_MM:
            low = middle + 1
        else:
            high = middle
    if low < len(walls.z) and abs(walls.z[low] - z) <= SAME_Z_MM:
        return low
    return -1


@kernel
def cuts(walls: Walls, s: int, ax: float, ay: float, bx: float, by: float) -> bool:
    """Tell whether wall segment s meets the segment from a to b."""
    px, py = walls.segments[s, 0], walls.segments[s, 1]
    qx, qy = walls.segments[s, 2], walls.segments[s, 3]
    one = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
    two = (bx - ax) * (qy - ay) - (by - ay) * (qx - ax)
    if (one > 0.0 and two > 0.0) or (one < 0.0 and two < 0.0):
        return False
    one = (qx - px) * (ay - py) - (qy - py) * (ax - px)
    two = (qx - px) * (by - py) - (qy - py) * (bx - px)
    if (one > 0.0 and two > 0.0) or (one < 0.0 and two < 0.0):
        return False
    return bool(
        max(ax, bx) >= min(px, qx) and max(px, qx) >= min(ax, bx)
        and max(ay, by) >= min(py, qy) and max(py, qy) >= min(ay, by)
    )  # fmt: skip


@kernel
def crosses(walls: Walls, k: int, ax: float, ay: float, bx: float, by: float) -> bool:
    """Tell whether a travel crosses a wall of layer k anywhere but at its ends."""
    length = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
    if length <= 2.0 * END_MM:
        return False
    ux, uy = (bx - ax) / length * END_MM, (by - ay) / length * END_MM
    ax, ay, bx, by = ax + ux, ay + uy, bx - ux, by - uy
    columns, rows = walls.size[k, 0], walls.size[k, 1]
    x0, y0, cell = walls.origin[k, 0], walls.origin[k, 1], walls.cell
    j, last = math.floor((min(ay, by) - y0) / cell), math.floor((max(ay, by) - y0) / cell)
    j, last = max(j, 0), min(last, rows - 1)
    while j <= last:
        low, high = min(ax, bx), max(ax, bx)
        if ay != by:
            slope = (bx - ax) / (by - ay)
            one = ax + (y0 + j * cell - ay) * slope
            two = ax + (y0 + (j + 1) * cell - ay) * slope
            low, high = max(low, min(one, two)), min(high, max(one, two))
        i = max(math.floor((low - 1e-6 - x0) / cell), 0)
        end = min(math.floor((high + 1e-6 - x0) / cell), columns - 1)
        while i <= end:
            at = walls.first[k] + j * columns + i
            for e in range(walls.starts[at], walls.starts[at + 1]):
                if cuts(walls, walls.listed[e], ax, ay, bx, by):
                    return True
            i += 1
        j += 1
    return False


@kernel
def is_inside(walls: Walls, k: int, x: float, y: float) -> bool:
    """Tell by the even-odd rule whether a point lies inside the walls of layer k."""
    columns, cell, x0 = walls.size[k, 0], walls.cell, walls.origin[k, 0]
    j = math.floor((y - walls.origin[k, 1]) / cell)
    i = math.floor((x - x0) / cell)
    if j < 0 or j >= walls.size[k, 1] or i < 0 or i >= columns:
        return False
    inside = False
    while i < columns:
        at = walls.first[k] + j * columns + i
        for e in range(walls.starts[at], walls.starts[at + 1]):
            s = walls.listed[e]
            py, qy = walls.segments[s, 1], walls.segments[s, 3]
            if (py > y) == (qy > y):
                continue
            px, qx = walls.segments[s, 0], walls.segments[s, 2]
            cut = px + (y - py) / (qy - py) * (qx - px)
            if cut > x and math.floor((cut - x0) / cell) == i:  # listed in other cells too
                inside = not inside
        i += 1
    return inside


@kernel
def bare(
    walls: Walls, longest: float, ax: float, ay: float, az: float, bx: float, by: float, bz: float
) -> bool:
    """Tell whether a travel inside the part stays unretracted: level, not too long, no wall."""
    if abs(az - bz) > SAME_Z_MM or (bx - ax) ** 2 + (by - ay) ** 2 > longest * longest:
        return False
    k = layer_at(walls, az)
    if k < 0 or crosses(walls, k, ax, ay, bx, by):
        return False
    return is_inside(walls, k, 0.5 * (ax + bx), 0.5 * (ay + by))


@kernel
def bare_travels(
    walls: Walls, longest: float, starts: NDArray[np.float64], goals: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return for each travel from starts to goals, (n, 3) each, whether it stays bare."""
    found = np.zeros(len(starts), np.bool_)
    for t in range(len(starts)):
        a, b = starts[t], goals[t]
        found[t] = bare(walls, longest, a[0], a[1], a[2], b[0], b[1], b[2])
    return found


@kernel
def over_walls(
    walls: Walls, starts: NDArray[np.float64], goals: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return for each travel whether it leads over a wall of the layer of either end, (n,)."""
    found = np.zeros(len(starts), np.bool_)
    for t in range(len(starts)):
        a, b = starts[t], goals[t]
        for z in (a[2], b[2]):
            k = layer_at(walls, z)
            if k >= 0 and crosses(walls, k, a[0], a[1], b[0], b[1]):
                found[t] = True
    return found


@kernel
def list_cells(
    layer: NDArray[np.int64], walls: Walls, counts: NDArray[np.int64], fill: bool
) -> None:
    """Count the segments of each cell, or list them from where `counts` stands (mutates both)."""
    for s in range(len(layer)):
        k = layer[s]
        x0, y0, columns = walls.origin[k, 0], walls.origin[k, 1], walls.size[k, 0]
        ax, ay = walls.segments[s, 0], walls.segments[s, 1]
        bx, by = walls.segments[s, 2], walls.segments[s, 3]
        first = math.floor((min(ay, by) - y0) / walls.cell)
        last = math.floor((max(ay, by) - y0) / walls.cell)
        for j in range(first, last + 1):
            low, high = min(ax, bx), max(ax, bx)
            if ay != by:
                slope = (bx - ax) / (by - ay)
                one = ax + (y0 + j * walls.cell - ay) * slope
                two = ax + (y0 + (j + 1) * walls.cell - ay) * slope
                low, high = max(low, min(one, two)), min(high, max(one, two))
            left = max(math.floor((low - 1e-6 - x0) / walls.cell), 0)
            right = min(math.floor((high + 1e-6 - x0) / walls.cell), columns - 1)
            for i in range(left, right + 1):
                at = walls.first[k] + j * columns + i
                if fill:
                    walls.listed[counts[at]] = s
                counts[at] += 1
