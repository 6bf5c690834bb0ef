"""How long cranes on one rail need at least, whatever they do.

At every moment the q cranes that work stand at bays `spacing` or more apart: a *row*
of at most q bays. The least total time of rows under which every bay gets its work is
a linear programme, a flow from bay to bay along the rail; travel is not counted.
The longest chain of precedence, from the nearest crane's start on, is a bound too.
Both are rounded down by more than the solver's tolerance. Where all times are whole
numbers the least makespan is one too, and the bound goes up to the next whole number.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.optimize import linprog

from decmcts.arrays import Floats, Ints
from decmcts.formats.bare.qcsp import QcspProblem

SAFETY = 1e-6  # relative; the solver's tolerance, taken off the bound
_MOST_ARCS = 200_000  # larger programmes take too long for what they say


def least_makespan(problem: QcspProblem) -> float:
    """Return a time before which no schedule ends."""
    if not len(problem):
        return 0.0
    bound = max(_longest_chain(problem), _rows(problem)) * (1.0 - SAFETY)
    times = np.concatenate([problem.duration, problem.ready, [problem.travel]])
    return float(np.ceil(bound)) if (times == times.round()).all() else float(bound)


def _longest_chain(problem: QcspProblem) -> float:
    """Return when the last of a chain of tasks can end, each reached from the last or a start."""
    travel = np.abs(problem.bay[:, None] - problem.start[None, :]) * problem.travel
    end = (problem.ready[None, :] + travel).min(axis=1) + problem.duration
    for _ in range(len(problem)):
        before = end.copy()
        i, j = problem.precedence.T
        np.maximum.at(end, j, end[i] + problem.duration[j])
        if np.array_equal(before, end):
            break
    return float(end.max())


def _rows(problem: QcspProblem) -> float:
    """Return the least time in which rows of bays can do all work."""
    bays, place = np.unique(problem.bay, return_inverse=True)
    work = np.bincount(place, problem.duration).astype(np.float64)
    q, m = min(problem.cranes, len(bays)), len(bays)
    first, second = np.nonzero(bays[None, :] - bays[:, None] >= problem.spacing)
    arcs = len(first) * (q - 1) + m * q
    if arcs > _MOST_ARCS:
        return float(work.sum()) / q
    return _flow(work, first, second, q)


def _flow(work: Floats, first: Ints, second: Ints, q: int) -> float:
    """Return the least flow that visits every bay for as long as its work takes.

    Node (k, b): the k-th of a row works at bay b. Unknowns: what begins at each bay,
    and what goes from (k, b) on to (k + 1, b') for each pair of bays far enough apart.
    A node passes on no more than it gets.
    """
    m, pairs, steps = len(work), np.arange(len(first)), np.eye(q - 1)
    went = sparse.coo_matrix((np.ones(len(first)), (first, pairs)), shape=(m, len(first)))
    came = sparse.coo_matrix((np.ones(len(first)), (second, pairs)), shape=(m, len(first)))
    cover = sparse.hstack([sparse.eye(m), sparse.kron(np.ones((1, q - 1)), came)], "csr")
    begun = sparse.kron(steps[:, :1], -sparse.eye(m)) if q > 1 else sparse.coo_matrix((0, m))
    onward = sparse.kron(steps, went) - sparse.kron(np.eye(q - 1, k=-1), came)
    passed = sparse.hstack([begun, onward], "csr")
    cost = np.append(np.ones(m), np.zeros(onward.shape[1]))
    none = np.zeros(passed.shape[0])
    solved = linprog(cost, A_ub=passed, b_ub=none, A_eq=cover, b_eq=work, method="highs")
    return float(solved.fun) if solved.status == 0 else float(work.sum()) / q
