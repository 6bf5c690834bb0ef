"""Macro-actions: the pieces a head's plan is made of.

A part is a connected footprint on the bed. Each part's work is cut into chunks, in
source order. Each chunk is cut again by the heads' shares of the machine in which
its contours lie; such a piece is a macro-action. A plan says how much later than
usual each macro-action comes, so plans stay short and messages small.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from decmcts.print.contours import Contours

CELL_MM = 1.0  # of the footprint's grid; also the gap that still joins two beads
COLUMN_MM = 25.0  # cells of columns: contours of one column begin and end in the same ones
MACROS = 120  # wanted pieces of one print


def part_of(contours: Contours) -> NDArray[np.int64]:
    """Return the part each contour belongs to, numbered from 0, (n,)."""
    if not len(contours):
        return np.empty(0, np.int64)
    x, y = contours.points[:, 0].copy(), contours.points[:, 1].copy()
    low = x.min() - 2 * CELL_MM, y.min() - 2 * CELL_MM
    column, row = _cells(x, low[0]), _cells(y, low[1])
    covered = np.zeros((column.max() + 4, row.max() + 4), np.bool_)
    covered[column, row] = True
    leaves = (column[1:] != column[:-1]) | (row[1:] != row[:-1])  # others lie in one cell
    leaves[contours.offsets[1:-1] - 1] = False  # no segment: the next contour begins
    x, y = _samples(x[:-1][leaves], y[:-1][leaves], x[1:][leaves], y[1:][leaves])
    covered[_cells(x, low[0]), _cells(y, low[1])] = True
    labels, _ = ndimage.label(covered, structure=np.ones((3, 3), np.int64))
    first = contours.offsets[:-1]
    return np.asarray(
        np.unique(labels[column[first], row[first]], return_inverse=True)[1], np.int64
    )


def _cells(at: NDArray[np.float64], low: float) -> NDArray[np.int64]:
    """Return the cell of each coordinate, counted from `low`."""
    return np.asarray(((at - low) / CELL_MM).astype(np.int64))


def _samples(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    to_x: NDArray[np.float64],
    to_y: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return points of segments a cell apart: they lie in cells that touch, if only at a corner."""
    steps = np.ceil(np.hypot(to_x - x, to_y - y) / CELL_MM).astype(np.int64) + 1
    segment = np.repeat(np.arange(len(x)), steps)
    along = (np.arange(len(segment)) - (np.cumsum(steps) - steps)[segment]) / steps[segment]
    return x[segment] + (to_x - x)[segment] * along, y[segment] + (to_y - y)[segment] * along


def numbered(*keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the rank of each row that these keys make, equal rows alike, (n,)."""
    code = np.zeros(len(keys[0]), np.int64)
    for key in keys:
        own = key - key.min(initial=0)
        code = code * (int(own.max(initial=0)) + 1) + own
    return np.asarray(np.unique(code, return_inverse=True)[1].reshape(-1))


def part_progress(seconds: NDArray[np.float64], part: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return how much of its part's work comes before each contour in the source, 0..1, (n,)."""
    order = np.argsort(part, kind="stable")
    done = np.cumsum(seconds[order]) - seconds[order]
    total = np.bincount(part, weights=seconds)
    first = np.concatenate([[0.0], np.cumsum(total)])[:-1]
    progress = np.empty(len(part))
    progress[order] = (done - first[part[order]]) / np.maximum(total[part[order]], 1e-12)
    return np.clip(progress, 0.0, 1.0)


def cut_macros(
    seconds: NDArray[np.float64],
    part: NDArray[np.int64],
    progress: NDArray[np.float64],
    side: NDArray[np.int64],
) -> NDArray[np.int32]:
    """Return the macro-action of each contour, numbered by progress, (n,).

    `side` (n,) is the head in whose share of the machine it lies.
    """
    if not len(part):
        return np.empty(0, np.int32)
    work = np.bincount(part, weights=seconds)
    chunks = np.maximum(1, np.rint(MACROS / 2 * work / max(work.sum(), 1e-12))).astype(np.int64)
    chunk = np.minimum((progress * chunks[part]).astype(np.int64), chunks[part] - 1)
    piece = numbered(part, chunk, side)
    middle = (chunk + 0.5) / chunks[part]
    when = np.bincount(piece, weights=middle) / np.bincount(piece)
    rank = np.empty(len(when), np.int32)
    rank[np.argsort(when, kind="stable")] = np.arange(len(when), dtype=np.int32)
    return rank[piece]


def columns_of(
    boxes: NDArray[np.float64], part: NDArray[np.int64], axis: int
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Return the contours by column: those of one part and one place, each in source order.

    `boxes` (n, 4) are min x, max x, min y and max y; the place is that along `axis`.
    Returns the offsets of the columns and the contours, column after column.
    """
    cells = (boxes[:, 2 * axis : 2 * axis + 2] // COLUMN_MM).astype(np.int64)
    column = numbered(part, cells[:, 0], cells[:, 1])
    order = np.argsort(column, kind="stable")
    count = int(column.max(initial=-1)) + 1
    return np.searchsorted(column[order], np.arange(count + 1)), order.astype(np.int32)
