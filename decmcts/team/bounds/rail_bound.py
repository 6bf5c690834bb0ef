"""How fast heads in order along one rail can be at best: a linear programme and its proof.

At every moment the heads that print stand a separation apart. Give each piece of work a
price per second, such that what can be printed at one moment costs at most 1 in all. Then
all work, at these prices, is worth V, and takes V seconds at least. The programme finds
the prices for which V is largest. With these prices a longest path finds exactly what can
cost most at one moment; V divided by that is a bound whatever the solver's tolerance.

Of two heads that print side by side one began later. A head that prints never waits, so it
began only when the other held nothing any more of the space of its *whole* contour. So of
two neighbours one is as wide as what it still holds, and one as wide as its whole contour.

A head that travels holds only the place it is at, and may be anywhere within reach of the
contour it left, or is to enter. So what counts is the interval that it holds at all of these
places. That may have negative width, `low` above `high`. Whole contours do not count for it.

Positions are rounded to cells so that heads fit more easily than in truth. Work is the
pieces of contours, each with the space its head still holds while it prints the piece. Where
a contour may be run from either end, the direction counts in which it is worth less.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.optimize import linprog

from decmcts.arrays import Flags, Floats, Ints

CELLS = 100  # of a separation; more are tighter and slower
MOST_CELLS = 960  # along the rail
MOST_PLACES = 20_000  # different ones; cells double until there are no more than this
COARSEST = 16  # cells of travels grow first, up to so many times as large as those of prints


class RailUse(NamedTuple):
    """What heads hold along the rail, piece by piece, and for how long."""

    low: Floats  # (k,) mm
    high: Floats  # (k,)
    seconds: Floats  # (k,)
    choice: Ints  # (k,) it belongs to: 2 c is contour c as sliced, 2 c + 1 reversed
    travels: Flags | None = None  # (k,) what is no print; None: nothing


def rail_bound(held: RailUse, *, separation_mm: float, heads: int) -> float:
    """Return seconds that no joint plan of this work can beat.

    The relaxation generalises the fractional matching of two heads to any number.
    """
    if not len(held.seconds) or not float(held.seconds.sum()) > 0.0:
        return 0.0
    places, place, apart = _places(held, separation_mm)
    worth = _worth(held, place, len(places.low))
    price = _prices(places, worth, heads, apart)
    value = worth.matrix @ price
    cheapest = np.minimum.reduceat(value, worth.begins)
    return float(cheapest.sum()) / _dearest(places, price, heads, apart)


class _RailCells(NamedTuple):
    """Cells that pieces hold, first and last, and those of their whole contours; each (k,)."""

    low: Ints
    high: Ints
    whole_low: Ints
    whole_high: Ints

    def width(self, apart: int) -> int:
        """Return how many cells the rail has, with space behind the last for one head more."""
        return int(max(self.low.max(), self.whole_high.max() + apart)) + 1


def _places(held: RailUse, separation_mm: float) -> tuple[_RailCells, Ints, int]:
    """Return the different places, the place of each piece, and the separation in cells."""
    travels = np.zeros(len(held.choice), np.bool_) if held.travels is None else held.travels
    edges = _edges(held, travels)
    cell = max(separation_mm / CELLS, float(np.ptp(edges)) / MOST_CELLS) or 1.0
    coarse = 1  # travels are less of the work: theirs is the first to be rounded more
    while True:
        grain = np.where(travels, coarse, 1)[:, None]
        first = np.ceil(edges[:, 0::2] / (cell * grain)) * grain
        last = edges[:, 1::2] // (cell * grain) * grain
        cells = np.stack([first, last], axis=2).reshape(-1, 4).astype(np.int64)
        places, place = np.unique(cells, axis=0, return_inverse=True)
        if len(places) <= MOST_PLACES:
            return _RailCells(*places.T), place.reshape(-1), int(separation_mm / cell)
        if travels.any() and coarse < COARSEST:
            coarse *= 2
        else:
            cell *= 2.0


def _edges(held: RailUse, travels: Flags) -> Floats:
    """Return where each piece and its whole contour begin and end, mm from the least, (k, 4)."""
    edges = np.column_stack([held.low, held.high, held.low, held.high])
    prints = ~travels
    whole = whole_of(held.choice[prints], held.low[prints], held.high[prints])
    edges[prints, 2], edges[prints, 3] = whole
    return np.asarray(edges - edges.min())  # widths may be negative, so any side may be least


def whole_of(choice: Ints, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Return where the whole contour of each piece begins and ends, in its choice, (k,) each."""
    choices, kind = np.unique(choice, return_inverse=True)
    kind = kind.reshape(-1)
    whole_low, whole_high = np.full(len(choices), np.inf), np.full(len(choices), -np.inf)
    np.minimum.at(whole_low, kind, low)
    np.maximum.at(whole_high, kind, high)
    return whole_low[kind], whole_high[kind]


class _Worth(NamedTuple):
    """How the worth of contours follows from the prices of places."""

    matrix: sparse.csr_matrix  # (choices, places) seconds a choice holds each place
    contour: Ints  # (choices,) ascending
    begins: Ints  # (contours,) first choice of each


def _worth(held: RailUse, place: Ints, places: int) -> _Worth:
    """Return the worth of all contours; those with one choice are put together."""
    contours = int(held.choice.max()) // 2 + 1
    both = np.zeros(contours, np.bool_)
    both[held.choice[held.choice % 2 == 1] // 2] = True
    free = both[held.choice // 2]
    choices, row = np.unique(np.where(free, held.choice, -1), return_inverse=True)
    shape = (len(choices), places)
    matrix = sparse.csr_matrix((held.seconds, (row.reshape(-1), place)), shape=shape)
    contour = choices // 2
    return _Worth(matrix, contour, np.flatnonzero(np.diff(contour, prepend=contour[0] - 1)))


def _prices(places: _RailCells, worth: _Worth, heads: int, apart: int) -> Floats:
    """Return the prices of most worth, (k,).

    Variables are the prices, the worth of each contour, a fee for each head, and the dearest
    that heads can print at once left of cell x, less their fees: where the last of them is as
    wide there as its whole contour, and where it is as wide as what it still holds. With the
    fee there is no need to count the heads, which keeps the programme small.
    """
    k, m, width = len(places.low), len(worth.begins), places.width(apart)
    fee, n = k + m, k + m + 1 + 2 * width
    dearest = fee + 1 + np.arange(2 * width).reshape(2, width)
    matrix = [_rows(n, (dearest[:, -1], 1.0), (np.full(2, fee), float(heads)))]
    each = [(np.arange(k), 1.0), (np.full(k, fee), -1.0)]
    for side, high in enumerate((places.whole_high, places.high)):
        matrix.append(_rows(n, (dearest[side, :-1], 1.0), (dearest[side, 1:], -1.0)))
        for before, low in enumerate((places.low, places.whole_low)):
            ends = [(dearest[before, low], 1.0), (dearest[side, high + apart], -1.0)]
            matrix.append(_rows(n, *each, *ends))
    choices = len(worth.contour)
    item = k + np.searchsorted(worth.contour[worth.begins], worth.contour)
    values = sparse.hstack([-worth.matrix, sparse.csr_matrix((choices, n - k))])
    matrix.append(_rows(n, (item, 1.0)) + values)
    aim = np.zeros(n)
    aim[k:fee] = -1.0
    together = sparse.vstack(matrix, format="csr")
    most = np.zeros(together.shape[0])
    most[:2] = 1.0  # what all heads together print at once
    found = linprog(aim, A_ub=together, b_ub=most, bounds=(0.0, None), method="highs-ipm")
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


def _dearest(places: _RailCells, price: Floats, heads: int, apart: int) -> float:
    """Return what can be printed at one moment costs at most."""
    width = places.width(apart)
    whole, rest = np.zeros(width), np.zeros(width)  # of the heads so far, left of each cell
    for _ in range(heads):
        value = np.maximum(whole[places.low], rest[places.whole_low]) + price
        whole, rest = whole.copy(), rest.copy()
        np.maximum.at(whole, places.whole_high + apart, value)
        np.maximum.at(rest, places.high + apart, value)
        whole, rest = np.maximum.accumulate(whole), np.maximum.accumulate(rest)
    return max(float(whole[-1]), float(rest[-1]), 1e-300)
