"""Groups moves into contours, on plain arrays.

A contour is a maximal continuous extrusion: moves that lay down filament, with nothing
between them but pauses that move nothing.
"""

from __future__ import annotations

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.compiled import kernel

PUSHED = 1e-7  # mm of filament that counts as extrusion (absolute E carries rounding)
MOVED = 1e-9  # mm
BLOB = 0.05  # mm of filament; a push below it inside a contour belongs to it, whatever is owed


@kernel
def group_moves(
    points: Floats,
    extrusion: Floats,
    surplus: Floats,
    lays: Flags,
    barriers_before: Ints,
    first: int,
    last: int,
) -> Ints:
    """Return the contour of each move in first..last, NO_CONTOUR (-1) for the others.

    `lays` are the moves that lay down filament wherever they stand. What is pushed
    standing still behind one of them, `surplus` beyond what was retracted, lies there too.
    `barriers_before` counts the barrier lines above each move; a contour never spans one.
    """
    contour = np.full(len(extrusion), -1, np.int64)
    current, n, wall = -1, 0, -1
    for m in range(first, last):
        dx = points[m + 1, 0] - points[m, 0]
        dy = points[m + 1, 1] - points[m, 1]
        dz = points[m + 1, 2] - points[m, 2]
        across = dx * dx + dy * dy > MOVED * MOVED
        if barriers_before[m] != wall:
            current = -1
            wall = barriers_before[m]
        stays = not across and abs(dz) <= MOVED
        blob = extrusion[m] > PUSHED and (extrusion[m] <= BLOB or surplus[m] > BLOB)
        if lays[m] or (current >= 0 and stays and blob):
            if current < 0:
                current = n
                n += 1
            contour[m] = current
        elif not stays or abs(extrusion[m]) > PUSHED:
            current = -1
    return contour


@kernel
def heaviest_label(offsets: Ints, weight: Floats, label: Ints, n_labels: int) -> Ints:
    """Return, per row of the CSR `offsets`, the label with the largest total weight."""
    result = np.zeros(len(offsets) - 1, np.int64)
    total = np.zeros(n_labels)
    for row in range(len(result)):
        best = -1.0
        for k in range(offsets[row], offsets[row + 1]):
            total[label[k]] += weight[k]
            if total[label[k]] > best:
                best = total[label[k]]
                result[row] = label[k]
        for k in range(offsets[row], offsets[row + 1]):
            total[label[k]] = 0.0
    return result
