"""How fast heads in order along one rail can be at best: a linear programme and its proof.

At every moment the heads that print stand a separation apart. So give each piece of work
a price such that what can be printed at one moment costs at most 1 in all: then work
worth V takes V seconds at least. The programme finds the prices of most worth. With them
a longest path finds what can be printed at one moment costs at most, exactly; dividing by
that, the result is a bound whatever the solver's tolerance.

Positions are rounded to cells so that heads fit more easily than in truth. Work is the
pieces of contours, each with the room its head still holds while it prints it; where a
contour may be run from either end, that way counts in which it is worth less.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import linprog

CELLS = 240  # along the rail; more are tighter and slower
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Held(NamedTuple):
    """What heads hold along the rail, piece by piece, and for how long."""

    low: Floats  # (k,) mm
    high: Floats  # (k,)
    seconds: Floats  # (k,)
    way: Ints  # (k,) the way through a contour it belongs to: 2 c along contour c, 2 c + 1 back


def rail_bound(held: Held, *, separation_mm: float, heads: int) -> float:
    """Return seconds that no joint plan of this work can beat.

    The relaxation generalises the fractional matching of two heads to any number.
    """
    if not len(held.seconds) or not float(held.seconds.sum()) > 0.0:
        return 0.0
    origin = held.low.min()
    cell = max(float(held.high.max() - origin), separation_mm) / CELLS
    ends = np.column_stack([np.ceil((held.low - origin) / cell), (held.high - origin) // cell])
    places, place = np.unique(ends.astype(np.int64), axis=0, return_inverse=True)
    first, last, apart = places[:, 0], places[:, 1], int(separation_mm / cell)
    worth = _worth(held, place.reshape(-1), len(places))
    price = _prices(first, last, worth, heads, apart)
    value = worth.matrix @ price
    cheapest = np.minimum.reduceat(value, worth.begins)
    return float(cheapest.sum()) / _dearest(first, last, price, heads, apart)


class _Worth(NamedTuple):
    """How the worth of contours follows from the prices of places."""

    matrix: sparse.csr_matrix  # (ways, places) seconds a way holds each place
    contour: Ints  # (ways,) ascending
    begins: Ints  # (contours,) first way of each


def _worth(held: Held, place: Ints, places: int) -> _Worth:
    """Return the worth of all contours; those with one way through are put together."""
    contours = int(held.way.max()) // 2 + 1
    both = np.zeros(contours, np.bool_)
    both[held.way[held.way % 2 == 1] // 2] = True
    free = both[held.way // 2]
    ways, way = np.unique(np.where(free, held.way, -1), return_inverse=True)
    matrix = sparse.csr_matrix((held.seconds, (way.reshape(-1), place)), shape=(len(ways), places))
    contour = ways // 2
    return _Worth(matrix, contour, np.flatnonzero(np.diff(contour, prepend=contour[0] - 1)))


def _prices(first: Ints, last: Ints, worth: _Worth, heads: int, apart: int) -> Floats:
    """Return the prices of most worth: of places `first`, `last`, (k,).

    Variables are the prices, the worth of each contour, and the dearest that h heads can
    print at once left of cell x, for each h and x.
    """
    k, m = len(first), len(worth.begins)
    width = int(max(first.max(), last.max() + apart)) + 1
    n = k + m + heads * width
    dearest = k + m + np.arange(heads * width).reshape(heads, width)
    matrix = []
    for h in range(heads):
        matrix.append(_rows(n, (dearest[h, :-1], 1.0), (dearest[h, 1:], -1.0)))
        parts = [(np.arange(k), 1.0), (dearest[h, last + apart], -1.0)]
        if h:
            matrix.append(_rows(n, (dearest[h - 1], 1.0), (dearest[h], -1.0)))
            parts.append((dearest[h - 1, first], 1.0))
        matrix.append(_rows(n, *parts))
    ways = len(worth.contour)
    item = k + np.searchsorted(worth.contour[worth.begins], worth.contour)
    values = sparse.hstack([-worth.matrix, sparse.csr_matrix((ways, n - k))])
    matrix.append(_rows(n, (item, 1.0)) + values)
    aim, upper = np.zeros(n), np.full(n, np.inf)
    aim[k : k + m], upper[dearest[-1, -1]] = -1.0, 1.0
    together = sparse.vstack(matrix, format="csr")
    found = linprog(
        aim, A_ub=together, b_ub=np.zeros(together.shape[0]),
        bounds=np.column_stack([np.zeros(n), upper]), method="highs",
    )  # fmt: skip
    if found.x is None:  # any prices give a bound: these that of work shared evenly
        return np.full(k, 1.0 / heads)
    return np.asarray(np.maximum(found.x[:k], 0.0))


def _rows(n: int, *parts: tuple[Ints, float]) -> sparse.csr_matrix:
    """Return rows of a matrix of n columns: of each part one entry a row."""
    count = len(parts[0][0])
    row = np.concatenate([np.arange(count)] * len(parts))
    column = np.concatenate([part[0] for part in parts])
    value = np.concatenate([np.full(count, part[1]) for part in parts])
    return sparse.csr_matrix((value, (row, column)), shape=(count, n))


def _dearest(first: Ints, last: Ints, price: Floats, heads: int, apart: int) -> float:
    """Return what can be printed at one moment costs at most."""
    width = int(max(first.max(), last.max() + apart)) + 1
    best = np.zeros(width)  # of the heads so far, left of each cell
    for _ in range(heads):
        more = best.copy()
        np.maximum.at(more, last + apart, best[first] + price)
        best = np.maximum.accumulate(more)
    return max(float(best[-1]), 1e-300)
