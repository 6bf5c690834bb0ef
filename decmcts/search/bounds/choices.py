"""The choices for each contour of a problem, and the points they begin and end at."""

from __future__ import annotations

import numpy as np

from decmcts.search.bounds.pricing_kernels import Choices
from decmcts.search.sequence.problem import OrderProblem


def choices_of(problem: OrderProblem, *, apart: bool = False) -> Choices:
    """Return the choices for each contour, one or two: as sliced or reversed; loops by any entry.

    With `apart` each entry of a loop is a choice of its own. Prices for them would raise
    bounds of the relaxation by some two per cent, and a step would take three times as long.
    """
    n, seams = len(problem), problem.seams
    entries = np.ones(n, np.int64) if seams is None else np.diff(seams.offsets)
    count = np.where(entries > 1, entries, 1 + problem.reversible)
    owner = np.repeat(np.arange(n), count)
    first = np.cumsum(count) - count
    place = np.arange(len(owner)) - first[owner]  # 1: reversed, of those that may be reversed
    into, out = 2 * owner + place, 2 * owner + 1 - place
    if seams is not None:
        chosen = entries[owner] > 1
        into[chosen] = 2 * (n + seams.offsets[owner] + place)[chosen]
        out[chosen] = into[chosen] + 1
    begins = np.flatnonzero((place == 0) | (entries[owner] == 1) | apart)
    choices = np.searchsorted(begins, np.append(first, len(owner)))
    pairs = np.append(begins, len(owner)).astype(np.int64)
    return Choices(problem.metric(), choices.astype(np.int64), pairs, into, out)
