"""The best of several sequences, stretch by stretch: what threads found apart is joined.

References
----------
Whitley, Hains & Howe 2009, "Tunneling between optima: partition crossover for the
traveling salesman problem" (independent parts are chosen one by one).
"""

from __future__ import annotations

import numpy as np

from decmcts._kernels.sequence.crossover import crossed
from decmcts.search.hybrid.pieces import Sequence


def crossover(sequences: list[Sequence]) -> Sequence:
    """Return the cheapest sequence of stretches of those given; no dearer than any.

    They are of one problem and stay as they are. Stretches end where two have printed
    the same contours, see `crossed`.
    """
    best = sequences[0].copy()
    if len(sequences) == 1:
        return best
    order, flip, seat = (
        np.stack([getattr(sequence, name) for sequence in sequences])
        for name in ("order", "flip", "seat")
    )
    followed = crossed(best.metric, order, flip, seat)
    best.order[:] = order[followed, np.arange(len(followed))]
    best.flip[best.order], best.seat[best.order] = (
        flip[followed, best.order],
        seat[followed, best.order],
    )
    return best
