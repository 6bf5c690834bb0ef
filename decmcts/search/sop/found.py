"""Which of the searches found the best sequence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.search.sequence.incumbent import Incumbent

FOUND_BY = ("start", "beam", "annealing", "assignments")


def offer(incumbent: Incumbent, order: NDArray[np.int32], name: str) -> None:
    """Offer a sequence and note who found it."""
    if incumbent.offer(order, incumbent.reversed):
        incumbent.notes["found_by"] = FOUND_BY.index(name)
