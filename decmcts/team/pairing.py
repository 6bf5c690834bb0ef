"""Which contours two heads should print at the same time: a fractional matching.

M is the most printing time that pairs of contours which do not conflict can
share: a linear programme over classes of contours with like boxes. Boxes are
shrunk onto a grid, so classes conflict less than their contours and M is never
too small. The duals price a contour: those of price 1 are scarce, an hour of
them not printed beside something of price 0 makes the print an hour longer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import linprog

from decmcts.team.space import Space

MAX_CLASSES = 150  # of boxes; off the rail the grid is coarsened until there are no more
GRID_MM = 0.5  # of boxes on a rail


@dataclass(frozen=True, slots=True)
class Pairing:
    """The matching of heads 0 and 1."""

    shared_s: float  # M, at most so long can both heads print
    price: NDArray[np.float64]  # (n,) 0..1, gain of M per second of this contour
    share: NDArray[np.float64]  # (2, n) part of each contour printed by head 0, 1 beside the other


@dataclass(frozen=True, slots=True)
class _Programme:
    """max gain·x, share·x <= seconds, balance·x = 0, 0 <= x <= most."""

    gain: NDArray[np.float64]
    share: sparse.csr_matrix
    seconds: NDArray[np.float64]
    balance: sparse.csr_matrix | None
    most: NDArray[np.float64]


def pair_work(seconds: NDArray[np.float64], space: Space) -> Pairing:
    """Match the work of heads 0 and 1; `seconds` (n,) is the time of each contour."""
    if not len(seconds):
        return Pairing(0.0, np.empty(0), np.empty((2, 0)))
    sides = np.flatnonzero(np.isfinite(space.gaps[0, 1]))
    if len(sides) == 1:
        return _pair_on_rail(seconds, space, int(sides[0]))
    step = 1.0
    while True:
        classes, place = _classes(space, step)
        if len(classes) <= MAX_CLASSES:
            return _pair_boxes(classes, place, seconds, space.gaps[0, 1])
        step *= 1.5


def _shrunk(boxes: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Return the boxes with every side moved inwards onto a grid (they may turn inside out)."""
    low = np.ceil(boxes[:, 0::2] / step - 1e-9)
    high = np.floor(boxes[:, 1::2] / step + 1e-9)
    return np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], axis=1) * step


def _unique(keys: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    table, place = np.unique(keys, axis=0, return_inverse=True)
    return table, place.reshape(-1).astype(np.int64)


def _classes(space: Space, step: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the distinct shrunk boxes with their heads, and each contour's."""
    return _unique(np.concatenate([_shrunk(space.boxes, step), space.eligible], axis=1))


def _total(seconds: NDArray[np.float64], place: NDArray[np.int64], n: int) -> NDArray[np.float64]:
    return np.bincount(place, weights=seconds, minlength=n).astype(np.float64)


def _pair_on_rail(seconds: NDArray[np.float64], space: Space, side: int) -> Pairing:
    """Match on a rail, where who can pair is nested along one axis.

    A contour of the lower head that reaches up to a pairs with one of the
    upper head that reaches down to b iff a + gap <= b. Work of the lower head
    enters a chain of grid cells at a + gap, that of the upper leaves it at b.
    """
    low, high = (0, 1) if side % 2 == 0 else (1, 0)
    axis, gap = 2 * (side // 2), float(space.gaps[0, 1, side])
    boxes = _shrunk(space.boxes, GRID_MM)
    table, place = _unique(
        np.stack([boxes[:, axis + 1] + gap, boxes[:, axis], *space.eligible.T], axis=1)
    )
    may = np.concatenate([table[:, 2 + low], table[:, 2 + high]])
    cells, at = np.unique(table[:, :2], return_inverse=True)
    total, k = _total(seconds, place, len(table)), len(cells)
    programme = _chain_programme(total, at.reshape(len(table), 2), may, k)
    best, price, x = _solve(programme)
    n = len(table)
    share = np.stack([x[:n], x[n : 2 * n]]) / np.maximum(total, 1e-12)
    return Pairing(best, price[place], share[[low, high]][:, place])


def _chain_programme(
    total: NDArray[np.float64], at: NDArray[np.int64], may: NDArray[np.float64], cells: int
) -> _Programme:
    """Variables: lower work (n), upper work (n), flow from cell j to j + 1 (cells)."""
    n = len(total)
    one, flow = np.arange(n), np.arange(cells)
    rows = np.concatenate([at[:, 0], at[:, 1], flow, flow[1:]])
    columns = np.concatenate([one, n + one, 2 * n + flow, 2 * n + flow[:-1]])
    signs = np.concatenate([np.ones(n), -np.ones(n), -np.ones(cells), np.ones(cells - 1)])
    eye = sparse.identity(n)
    return _Programme(
        np.concatenate([np.zeros(n), np.ones(n), np.zeros(cells)]),
        sparse.csr_matrix(sparse.hstack([eye, eye, sparse.csr_matrix((n, cells))])),
        total,
        sparse.csr_matrix((signs, (rows, columns)), shape=(cells, 2 * n + cells)),
        np.concatenate([np.where(may > 0, np.inf, 0.0), np.full(cells, np.inf)]),
    )


def _pair_boxes(
    classes: NDArray[np.float64],
    place: NDArray[np.int64],
    seconds: NDArray[np.float64],
    gap: NDArray[np.float64],
) -> Pairing:
    """Match classes of boxes by listing the pairs that do not conflict."""
    u, v = classes[:, None, :], classes[None, :, :]
    clear = (u[..., 1] + gap[0] <= v[..., 0]) | (v[..., 1] + gap[1] <= u[..., 0])
    clear |= (u[..., 3] + gap[2] <= v[..., 2]) | (v[..., 3] + gap[3] <= u[..., 2])
    clear &= (classes[:, None, 4] > 0) & (classes[None, :, 5] > 0)
    lower, upper = np.nonzero(clear)
    n, total = len(classes), _total(seconds, place, len(classes))
    if not len(lower):
        return Pairing(0.0, np.zeros(len(place)), np.zeros((2, len(place))))
    pairs = np.arange(len(lower))
    rows = np.concatenate([lower, upper])
    uses = sparse.csr_matrix(
        (np.ones(2 * len(pairs)), (rows, np.concatenate([pairs, pairs]))), shape=(n, len(pairs))
    )
    most = np.full(len(pairs), np.inf)
    best, price, x = _solve(_Programme(np.ones(len(pairs)), uses, total, None, most))
    share = np.stack([_total(x, lower, n), _total(x, upper, n)]) / np.maximum(total, 1e-12)
    return Pairing(best, price[place], share[:, place])


def _solve(
    programme: _Programme,
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Return the maximum, the dual of each share row and the solution."""
    balance = programme.balance
    result = linprog(
        -programme.gain,
        A_ub=programme.share,
        b_ub=programme.seconds,
        A_eq=balance,
        b_eq=None if balance is None else np.zeros(balance.shape[0]),
        bounds=np.stack([np.zeros(len(programme.most)), programme.most], axis=1),
        method="highs",
    )
    if result.status != 0:  # without an optimum only the trivial bound is safe
        half = float(programme.seconds.sum()) / 2.0
        return half, np.full(len(programme.seconds), 0.5), np.zeros(len(programme.gain))
    price = np.clip(-np.asarray(result.ineqlin.marginals), 0.0, 1.0)
    return float(-result.fun), price, np.asarray(result.x, np.float64)
