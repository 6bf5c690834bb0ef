"""How fast two heads can be at best: a lower bound on the makespan.

At every moment two printing heads work on contours that do not conflict. With
W the time of all printing and M the most time such pairs can share, two heads
need at least W - M. M is a fractional matching, a linear programme over
classes of contours with like boxes; boxes are shrunk onto a grid, so the
classes conflict less than the contours and the bound stays a bound. Travel is
not counted. More than two heads: W divided by their number instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import linprog

from decmcts._kernels.bound import longest_chain
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.motion import contour_times
from decmcts.team.space import Space, build_space

MAX_CLASSES = 150  # of boxes; off the rail the grid is coarsened until there are no more
GRID_MM = 0.5  # of boxes on a rail
SAFETY = 1e-6  # relative; the solver's tolerance, taken off the bound


@dataclass(frozen=True, slots=True)
class Bound:
    """Lower bounds on the makespan in seconds, and what they allow at most."""

    serial_s: float  # W: all printing by one head, without travel
    overlap_s: float  # M: most time that two heads can print at once
    chain_s: float  # longest chain of the dependency graph
    exclusive_s: float  # most work that only one head can do
    bound_s: float  # no plan of these heads prints faster
    speedup: float  # serial_s / bound_s: at most so many times faster


def makespan_bound(
    job: PrintJob,
    machine: Machine,
    graph: DependencyGraph,
    *,
    seconds: NDArray[np.float64] | None = None,
) -> Bound:
    """Return the conflict-aware bound for all heads of the machine.

    Parameters
    ----------
    seconds : (n,) or None
        Printing time of each contour; None: the machine's time model.
    """
    space = build_space(job.contours, machine)
    time = contour_times(job.contours, machine.limits) if seconds is None else seconds
    serial, heads = float(time.sum()), len(machine.heads)
    chain = float(longest_chain(time, graph.pred_offsets, graph.preds))
    alone = space.eligible.sum(axis=1) == 1
    exclusive = max(
        (float(time[alone & space.eligible[:, r]].sum()) for r in range(heads)), default=0.0
    )
    overlap = serial * (1.0 - 1.0 / heads)
    if heads == 2:
        overlap = min(overlap, shared_time(time, space))
    bound = max(serial - overlap, chain, exclusive) * (1.0 - SAFETY)
    return Bound(serial, overlap, chain, exclusive, bound, serial / bound if bound > 0.0 else 1.0)


def shared_time(seconds: NDArray[np.float64], space: Space) -> float:
    """Return M, the most seconds in which heads 0 and 1 can both print."""
    if not len(seconds):
        return 0.0
    sides = np.flatnonzero(np.isfinite(space.gaps[0, 1]))
    if len(sides) == 1:
        return _chain_matching(seconds, space, int(sides[0]))
    step = 1.0
    while True:
        boxes, eligible, time = _classes(seconds, space, step)
        if len(time) <= MAX_CLASSES:
            return _pair_matching(boxes, eligible, time, space.gaps[0, 1])
        step *= 1.5


def _shrunk(boxes: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Return the boxes with every side moved inwards onto a grid (they may turn inside out)."""
    low = np.ceil(boxes[:, 0::2] / step - 1e-9)
    high = np.floor(boxes[:, 1::2] / step + 1e-9)
    return np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], axis=1) * step


def _classes(
    seconds: NDArray[np.float64], space: Space, step: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]:
    """Merge contours whose shrunk boxes and whose heads are the same."""
    keys = np.concatenate([_shrunk(space.boxes, step), space.eligible], axis=1)
    table, place = np.unique(keys, axis=0, return_inverse=True)
    time = np.bincount(place.reshape(-1), weights=seconds, minlength=len(table))
    return table[:, :4], table[:, 4:] > 0.5, time


def _chain_matching(seconds: NDArray[np.float64], space: Space, side: int) -> float:
    """Maximum matching on a rail, where who can pair is nested along one axis.

    A contour of the lower head that reaches up to a pairs with one of the
    upper head that reaches down to b iff a + gap <= b. Work of the lower head
    enters a chain of grid cells at a + gap, that of the upper leaves it at b.
    """
    low, high = (0, 1) if side % 2 == 0 else (1, 0)
    axis, gap = 2 * (side // 2), float(space.gaps[0, 1, side])
    boxes = _shrunk(space.boxes, GRID_MM)
    keys = np.stack([boxes[:, axis + 1] + gap, boxes[:, axis], *space.eligible.T], axis=1)
    table, place = np.unique(keys, axis=0, return_inverse=True)
    time = np.bincount(place.reshape(-1), weights=seconds, minlength=len(table))
    cells, at = np.unique(table[:, :2], return_inverse=True)
    at = at.reshape(len(table), 2)
    n, k = len(table), len(cells)
    one = np.arange(n)
    # variables: lower work (n), upper work (n), flow from cell j to j + 1 (k)
    flow = np.arange(k)
    rows = np.concatenate([at[:, 0], at[:, 1], flow, flow[1:]])
    columns = np.concatenate([one, n + one, 2 * n + flow, 2 * n + flow[:-1]])
    signs = np.concatenate([np.ones(n), -np.ones(n), -np.ones(k), np.ones(k - 1)])
    balance = sparse.csr_matrix((signs, (rows, columns)), shape=(k, 2 * n + k))
    eye = sparse.identity(n)
    share = sparse.hstack([eye, eye, sparse.csr_matrix((n, k))])
    most = np.concatenate([time * (table[:, 2 + low] > 0), time * (table[:, 2 + high] > 0)])
    return _maximum(
        np.concatenate([np.zeros(n), np.ones(n), np.zeros(k)]),
        sparse.csr_matrix(share),
        time,
        balance,
        np.concatenate([most, np.full(k, np.inf)]),
    )


def _pair_matching(
    boxes: NDArray[np.float64],
    eligible: NDArray[np.bool_],
    time: NDArray[np.float64],
    gap: NDArray[np.float64],
) -> float:
    """Maximum matching of classes by listing the pairs that do not conflict."""
    u, v = boxes[:, None, :], boxes[None, :, :]
    clear = (u[..., 1] + gap[0] <= v[..., 0]) | (v[..., 1] + gap[1] <= u[..., 0])
    clear |= (u[..., 3] + gap[2] <= v[..., 2]) | (v[..., 3] + gap[3] <= u[..., 2])
    clear &= eligible[:, None, 0] & eligible[None, :, 1]
    lower, upper = np.nonzero(clear)
    if not len(lower):
        return 0.0
    pairs = np.arange(len(lower))
    ones = np.ones(2 * len(pairs))
    share = sparse.csr_matrix(
        (ones, (np.concatenate([lower, upper]), np.concatenate([pairs, pairs]))),
        shape=(len(time), len(pairs)),
    )
    return _maximum(np.ones(len(pairs)), share, time, None, np.full(len(pairs), np.inf))


def _maximum(
    gain: NDArray[np.float64],
    share: sparse.csr_matrix,
    time: NDArray[np.float64],
    balance: sparse.csr_matrix | None,
    most: NDArray[np.float64],
) -> float:
    """Solve max gain·x with share·x <= time, balance·x = 0, 0 <= x <= most."""
    result = linprog(
        -gain,
        A_ub=share,
        b_ub=time,
        A_eq=balance,
        b_eq=None if balance is None else np.zeros(balance.shape[0]),
        bounds=np.stack([np.zeros(len(most)), most], axis=1),
        method="highs",
    )
    if result.status != 0:  # never seen; without an optimum only the trivial bound is safe
        return float(time.sum()) / 2.0
    return float(-result.fun)
