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
    points = contours.points[:, :2]
    if not len(contours):
        return np.empty(0, np.int64)
    low = points.min(axis=0) - 2 * CELL_MM
    shape = np.ceil((points.max(axis=0) - low) / CELL_MM).astype(np.int64) + 3
    covered = np.zeros(shape, np.bool_)
    starts = np.zeros(len(points), np.bool_)
    starts[contours.offsets[:-1]] = True
    a, b = points[:-1][~starts[1:]], points[1:][~starts[1:]]
    # samples a cell apart lie in cells that touch, if only at a corner
    steps = np.ceil(np.linalg.norm(b - a, axis=1) / CELL_MM).astype(np.int64) + 1
    segment = np.repeat(np.arange(len(a)), steps)
    along = (np.arange(len(segment)) - np.repeat(np.cumsum(steps) - steps, steps)) / np.repeat(
        steps, steps
    )
    samples = np.concatenate([a[segment] + (b - a)[segment] * along[:, None], points])
    cells = ((samples - low) / CELL_MM).astype(np.int64)
    covered[cells[:, 0], cells[:, 1]] = True
    labels, _ = ndimage.label(covered, structure=np.ones((3, 3), np.int64))
    at = ((contours.start[:, :2] - low) / CELL_MM).astype(np.int64)
    return np.asarray(np.unique(labels[at[:, 0], at[:, 1]], return_inverse=True)[1], np.int64)


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
    _, piece = np.unique(np.stack([part, chunk, side], axis=1), axis=0, return_inverse=True)
    piece = piece.reshape(-1)
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
    _, column = np.unique(np.column_stack([part, cells]), axis=0, return_inverse=True)
    column = column.reshape(-1)
    order = np.argsort(column, kind="stable")
    count = int(column.max(initial=-1)) + 1
    return np.searchsorted(column[order], np.arange(count + 1)), order.astype(np.int32)
