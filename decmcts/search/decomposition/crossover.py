"""Partition crossover: of several sequences the best one in each window.

So what threads found in different places is kept together.

References
----------
Whitley, Hains & Howe 2009, "Tunneling between optima: partition crossover for the
traveling salesman problem" (independent parts are chosen one by one).
"""

from __future__ import annotations

import numpy as np

from decmcts._kernels.decomposition.crossover import crossed
from decmcts.search.decomposition.blocks import Sequence


def crossover(sequences: list[Sequence]) -> Sequence:
    """Return the cheapest sequence of windows of those given; no dearer than any.

    All are of one problem, and none is changed. A window ends where two of them have
    printed the same set of contours, see `crossed`.
    """
    best = sequences[0].copy()
    if len(sequences) == 1:
        return best
    order, is_reversed, entry_id = (
        np.stack([getattr(sequence, name) for sequence in sequences])
        for name in ("order", "reversed", "entry_id")
    )
    followed = crossed(best.metric, order, is_reversed, entry_id)
    best.order[:] = order[followed, np.arange(len(followed))]
    best.reversed[best.order], best.entry_id[best.order] = (
        is_reversed[followed, best.order],
        entry_id[followed, best.order],
    )
    return best
