"""When two heads are in each other's way, on bare arrays.

The room a head takes while it acts is the bounding box of its nozzle's path,
`(min x, max x, min y, max y)`. `gaps[r, s]` says how far the boxes must be
apart: head r is clear of s iff along x or y one box ends `gap` before the
other begins. On a rail only one side of one axis counts. `decmcts.team.space`
derives the gaps from bodies, slices and rail, so that "clear" here is never
optimistic.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel

BELOW_X, ABOVE_X, BELOW_Y, ABOVE_Y = 0, 1, 2, 3  # columns of gaps[r, s]
TOUCH = 1e-9  # mm; boxes exactly a gap apart are clear


@kernel
def conflicts(u: NDArray[np.float64], v: NDArray[np.float64], gap: NDArray[np.float64]) -> bool:
    """Whether box `u` of head r and box `v` of head s are too near; `gap` = gaps[r, s]."""
    if u[1] + gap[0] <= v[0] + TOUCH or v[1] + gap[1] <= u[0] + TOUCH:
        return False
    return not (u[3] + gap[2] <= v[2] + TOUCH or v[3] + gap[3] <= u[2] + TOUCH)
