"""Whether a straight travel stays inside the part: outer walls by layer, in a uniform grid.

Each layer's wall segments are listed by the cells they touch. A travel walks the
cells under it; no segment of these may cross it, but for walls its ends lie on.
Then it is inside or outside as a whole, which its middle tells by the even-odd rule.
"""

from __future__ import annotations

import math

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.compiled import kernel

END_MM = 0.05  # of a travel at both ends that may touch a wall: its ends may lie on one
SAME_Z_MM = 1e-6

# Walls are one array, so that a metric that has them is passed on as fast as one without:
# cell size, layers, where the starts of cells and where the segments begin; six numbers a
# layer, ascending in z; a start for each cell and one more; x0, y0, x1, y1 of each segment,
# once for every cell it touches. Cell (i, j) of a layer is its first + j * columns + i.
Walls = Floats
CELL, LAYERS, STARTS, SEGMENTS, HEAD = range(5)
Z, X0, Y0, COLUMNS, ROWS, FIRST, PER_LAYER = range(7)


@kernel
def layer_at(walls: Walls, z: float) -> int:
    """Return where the layer whose walls lie at z is described, -1 for none."""
    low, high = 0, int(walls[LAYERS])
    while low < high:
        middle = (low + high) // 2
        if walls[HEAD + PER_LAYER * middle + Z] < z - SAME_Z_MM:
            low = middle + 1
        else:
            high = middle
    at = HEAD + PER_LAYER * low
    if low < walls[LAYERS] and abs(walls[at + Z] - z) <= SAME_Z_MM:
        return int(at)
    return -1


@kernel
def listed_in(walls: Walls, cell: int) -> tuple[int, int]:
    """Return where the segments of a cell begin and end."""
    at = int(walls[STARTS]) + cell
    first = int(walls[SEGMENTS])
    return first + 4 * int(walls[at]), first + 4 * int(walls[at + 1])


@kernel
def cuts(walls: Walls, s: int, ax: float, ay: float, bx: float, by: float) -> bool:
    """Tell whether the wall segment at s meets the segment from a to b."""
    px, py, qx, qy = walls[s], walls[s + 1], walls[s + 2], walls[s + 3]
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
    """Tell whether a travel crosses a wall of the layer at k anywhere but at its ends."""
    length = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
    if length <= 2.0 * END_MM:
        return False
    ux, uy = (bx - ax) / length * END_MM, (by - ay) / length * END_MM
    ax, ay, bx, by = ax + ux, ay + uy, bx - ux, by - uy
    columns, rows = int(walls[k + COLUMNS]), int(walls[k + ROWS])
    x0, y0, cell = walls[k + X0], walls[k + Y0], walls[CELL]
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
            first, behind = listed_in(walls, int(walls[k + FIRST]) + j * columns + i)
            for s in range(first, behind, 4):
                if cuts(walls, s, ax, ay, bx, by):
                    return True
            i += 1
        j += 1
    return False


@kernel
def is_inside(walls: Walls, k: int, x: float, y: float) -> bool:
    """Tell by the even-odd rule whether a point lies inside the walls of the layer at k."""
    columns, cell, x0 = int(walls[k + COLUMNS]), walls[CELL], walls[k + X0]
    j = math.floor((y - walls[k + Y0]) / cell)
    i = math.floor((x - x0) / cell)
    if j < 0 or j >= walls[k + ROWS] or i < 0 or i >= columns:
        return False
    inside = False
    while i < columns:
        first, behind = listed_in(walls, int(walls[k + FIRST]) + j * columns + i)
        for s in range(first, behind, 4):
            py, qy = walls[s + 1], walls[s + 3]
            if (py > y) == (qy > y):
                continue
            px, qx = walls[s], walls[s + 2]
            cut = px + (y - py) / (qy - py) * (qx - px)
            if cut > x and math.floor((cut - x0) / cell) == i:  # listed in other cells too
                inside = not inside
        i += 1
    return inside


@kernel
def stays_inside(walls: Walls, z: float, ax: float, ay: float, bx: float, by: float) -> bool:
    """Tell whether a travel seen from above stays inside the part on the layer at z."""
    k = layer_at(walls, z)
    if k < 0 or crosses(walls, k, ax, ay, bx, by):
        return False
    return is_inside(walls, k, 0.5 * (ax + bx), 0.5 * (ay + by))


@kernel
def bare(
    walls: Walls, longest: float, climb: float,
    ax: float, ay: float, az: float, bx: float, by: float, bz: float,
) -> bool:  # fmt: skip
    """Tell whether a travel stays unretracted: not too long, and inside the part.

    One that climbs, by at most `climb`, is inside if it is on the layers of both ends.
    """
    rise = bz - az
    if rise < -SAME_Z_MM or rise > climb + SAME_Z_MM:
        return False
    if (bx - ax) ** 2 + (by - ay) ** 2 > longest * longest:
        return False
    if not stays_inside(walls, az, ax, ay, bx, by):
        return False
    return rise <= SAME_Z_MM or stays_inside(walls, bz, ax, ay, bx, by)


@kernel
def bare_travels(
    walls: Walls,
    longest: float,
    climb: float,
    starts: Floats,
    goals: Floats,
) -> Flags:
    """Return for each travel from starts to goals, (n, 3) each, whether it stays bare."""
    found = np.zeros(len(starts), np.bool_)
    for t in range(len(starts)):
        a, b = starts[t], goals[t]
        found[t] = bare(walls, longest, climb, a[0], a[1], a[2], b[0], b[1], b[2])
    return found


@kernel
def over_either(walls: Walls, ka: int, kb: int, ax: float, ay: float, bx: float, by: float) -> bool:
    """Tell whether a travel crosses a wall of the layer at ka or at kb, each -1 for none."""
    if ka >= 0 and crosses(walls, ka, ax, ay, bx, by):
        return True
    return bool(kb >= 0 and kb != ka and crosses(walls, kb, ax, ay, bx, by))


@kernel
def over_walls(walls: Walls, starts: Floats, goals: Floats) -> Flags:
    """Return for each travel whether it leads over a wall of the layer of either end, (n,)."""
    found = np.zeros(len(starts), np.bool_)
    for t in range(len(starts)):
        a, b = starts[t], goals[t]
        ka, kb = layer_at(walls, a[2]), layer_at(walls, b[2])
        found[t] = over_either(walls, ka, kb, a[0], a[1], b[0], b[1])
    return found


@kernel
def list_cells(segments: Floats, layer: Ints, walls: Walls, counts: Ints, fill: bool) -> None:
    """Count the segments (s, 4) of each cell, or list them (mutates counts, and walls).

    Cell c lists its next one at place counts[c].
    """
    for s in range(len(layer)):
        k = HEAD + PER_LAYER * layer[s]
        x0, y0, cell, columns = walls[k + X0], walls[k + Y0], walls[CELL], int(walls[k + COLUMNS])
        ax, ay, bx, by = segments[s, 0], segments[s, 1], segments[s, 2], segments[s, 3]
        first = math.floor((min(ay, by) - y0) / cell)
        last = math.floor((max(ay, by) - y0) / cell)
        for j in range(first, last + 1):
            low, high = min(ax, bx), max(ax, bx)
            if ay != by:
                slope = (bx - ax) / (by - ay)
                one = ax + (y0 + j * cell - ay) * slope
                two = ax + (y0 + (j + 1) * cell - ay) * slope
                low, high = max(low, min(one, two)), min(high, max(one, two))
            left = max(math.floor((low - 1e-6 - x0) / cell), 0)
            right = min(math.floor((high + 1e-6 - x0) / cell), columns - 1)
            for i in range(left, right + 1):
                at = int(walls[k + FIRST]) + j * columns + i
                if fill:
                    place = int(walls[SEGMENTS]) + 4 * counts[at]
                    walls[place : place + 4] = segments[s]
                counts[at] += 1
