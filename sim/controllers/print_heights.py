"""How high the print stands while it grows, by cells of a grid.

Each cell keeps its highest point of a bead. Squares of 2, 4, 8 … cells a side keep the highest of
all their cells, so that a search passes over wide areas where nothing is high enough.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.arrays import Floats, Ints
from sim.controllers.compiled import compiled

CELL_MM = 0.25
MOST_CELLS = 1 << 22  # of larger prints cells are larger
NOTHING = -1  # no move: a cell where nothing is printed


class Heights(NamedTuple):
    """The print as it stands at some time."""

    corner: Floats  # (2,) least x and y
    cell_mm: float
    first: Ints  # (levels,) where the squares of each level begin in `top`; level 0: cells
    columns: Ints  # (levels,)
    rows: Ints  # (levels,)
    top: Floats  # (n,) mm, of each square; -inf: nothing is printed there
    spot: Floats  # (cells, 2) where the highest point of each cell lies
    move: Ints  # (cells,) and which move laid it


def bare(low: Floats, high: Floats) -> Heights:
    """Return a bed without print, from least to most x and y of all that will be printed."""
    size = np.maximum(high[:2] - low[:2], 0.0)
    cell = max(CELL_MM, float(np.sqrt(size.prod() / MOST_CELLS)), float(size.max() / MOST_CELLS))
    columns, rows = (int(side / cell) + 1 for side in size.tolist())
    sides = [(columns, rows)]
    while columns > 1 or rows > 1:
        columns, rows = (columns + 1) // 2, (rows + 1) // 2
        sides.append((columns, rows))
    table = np.array(sides, np.int64)
    ends = np.cumsum(table.prod(axis=1))
    cells = int(ends[0])
    return Heights(
        np.array(low[:2], np.float64), cell, np.concatenate([[0], ends[:-1]]),
        table[:, 0].copy(), table[:, 1].copy(), np.full(ends[-1], -np.inf),
        np.zeros((cells, 2)), np.full(cells, NOTHING, np.int64),
    )  # fmt: skip


@compiled
def lay(heights: Heights, start: Floats, end: Floats, move: int) -> None:
    """Put a bead into the grid, in place, by points no more than a cell apart."""
    x, y, z = start[0], start[1], start[2]
    dx, dy, dz = end[0] - x, end[1] - y, end[2] - z
    n = int(np.hypot(dx, dy) / heights.cell_mm) + 1
    for k in range(n + 1):
        share = k / n
        _raise(heights, x + share * dx, y + share * dy, z + share * dz, move)


@compiled
def _raise(heights: Heights, x: float, y: float, z: float, move: int) -> None:
    """Note one point of a bead, in place."""
    column = int((x - heights.corner[0]) / heights.cell_mm)
    row = int((y - heights.corner[1]) / heights.cell_mm)
    at = row * heights.columns[0] + column
    if z <= heights.top[at]:
        return
    heights.top[at], heights.move[at] = z, move
    heights.spot[at, 0], heights.spot[at, 1] = x, y
    for level in range(1, len(heights.columns)):
        column, row = column // 2, row // 2
        at = heights.first[level] + row * heights.columns[level] + column
        if z <= heights.top[at]:
            return
        heights.top[at] = z
