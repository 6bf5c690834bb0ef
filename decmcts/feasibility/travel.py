"""Room for the heights of what is printed, by which travels lift clear of it.

Schedulers route travels by the kernels of `decmcts.feasibility.travel_kernels`.
"""

from __future__ import annotations

import numpy as np

from decmcts.feasibility.travel_kernels import EMPTY, FANOUT, HeightField
from decmcts.print.contours import Contours

CELL_MM = 0.5


def new_height_field(
    contours: Contours, *, clearance_mm: float, cell_mm: float = CELL_MM
) -> HeightField:
    """Return an empty field that holds all these contours, for any head.

    Raises
    ------
    ValueError
        If `cell_mm` is not above 0.
    """
    if not cell_mm > 0.0:
        raise ValueError(f"cell_mm is {cell_mm}, it must be above 0")
    low, high = np.zeros(2), np.zeros(2)
    if len(contours):
        margin = clearance_mm + float(contours.width.max()) / 2 + cell_mm
        low = contours.points[:, :2].min(axis=0) - margin
        high = contours.points[:, :2].max(axis=0) + margin
    shapes = [np.maximum(np.ceil((high - low) / cell_mm).astype(np.int64), 1)]
    while shapes[-1].max() > 1:
        shapes.append(-(-shapes[-1] // FANOUT))
    sizes = [int(shape.prod()) for shape in shapes]
    return HeightField(
        np.full(sum(sizes), EMPTY),
        np.concatenate([[0], np.cumsum(sizes[:-1])]).astype(np.int64),
        np.array(shapes),
        low,
        np.array([cell_mm * FANOUT**level for level in range(len(shapes))]),
    )
