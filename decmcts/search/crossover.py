"""The best of two sequences, stretch by stretch: what lanes found apart is joined.

References
----------
Whitley, Hains & Howe 2009, "Tunneling between optima: partition crossover for the
traveling salesman problem" (independent parts are chosen one by one).
"""

from __future__ import annotations

from functools import reduce

from decmcts._kernels.crossover import crossed
from decmcts.search.pieces import Sequence


def crossover(one: Sequence, other: Sequence) -> Sequence:
    """Return the cheapest sequence of stretches of two of one problem; no dearer than either.

    Stretches end where both have printed the same contours, see `crossed`.
    """
    there = crossed(one.metric, one.order, one.flip, one.seat, other.order, other.flip, other.seat)
    best = one.copy()
    best.order[there] = other.order[there]
    changed = other.order[there]
    best.flip[changed], best.seat[changed] = other.flip[changed], other.seat[changed]
    return best


def joined(sequences: list[Sequence]) -> Sequence:
    """Return the best of what the sequences have, stretch by stretch, loops entered anew."""
    first, *rest = sequences
    best = reduce(crossover, rest, first.copy())
    best.settle()
    return best
