"""The ways to print each contour of a problem, and the points they begin and end at."""

from __future__ import annotations

import numpy as np

from decmcts._kernels.exact.pricing import Ways
from decmcts.search.sequence.problem import OrderProblem


def ways_of(problem: OrderProblem, *, apart: bool = False) -> Ways:
    """Return the ways to print each contour, one or two: as sliced or turned; loops by any option.

    With `apart` each option of a loop is a way of its own. Prices for them would raise
    bounds of the relaxation by some two per cent, and a step would take three times as long.
    """
    n, seams = len(problem), problem.seams
    options = np.ones(n, np.int64) if seams is None else np.diff(seams.offsets)
    count = np.where(options > 1, options, 1 + problem.reversible)
    owner = np.repeat(np.arange(n), count)
    first = np.cumsum(count) - count
    place = np.arange(len(owner)) - first[owner]  # 1: backwards, of those that may turn
    into, out = 2 * owner + place, 2 * owner + 1 - place
    if seams is not None:
        chosen = options[owner] > 1
        into[chosen] = 2 * (n + seams.offsets[owner] + place)[chosen]
        out[chosen] = into[chosen] + 1
    begins = np.flatnonzero((place == 0) | (options[owner] == 1) | apart)
    ways = np.searchsorted(begins, np.append(first, len(owner)))
    pairs = np.append(begins, len(owner)).astype(np.int64)
    return Ways(problem.metric(), ways.astype(np.int64), pairs, into, out)
