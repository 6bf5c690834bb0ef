"""Bare problems: solving them, compiling their kernels first, and checking a sequence found."""

from __future__ import annotations

import numpy as np

from decmcts.arguments import checked
from decmcts.arrays import Floats, Int32s
from decmcts.errors import VerificationError
from decmcts.formats.bare.qcsp import QcspProblem
from decmcts.formats.bare.sop import SopInstance
from decmcts.planning.events import Report, Stop, never, unheard
from decmcts.search.sequence.stopping import Stopping
from decmcts.search.sop.solver import SopResult, search_sop
from decmcts.team.qcsp.solver import QcspResult, search_qcsp


@checked
def solve_sop(
    costs: Floats,
    precedence: Int32s,
    *,
    time_limit_s: float = 30.0,
    seed: int = 0,
    max_iterations: int | None = None,
    report: Report = unheard,
    stop: Stop = never,
) -> SopResult:
    """Find a cheap sequence of all nodes that keeps the precedence, on two threads.

    Ends early when the result is proven optimal.

    Parameters
    ----------
    costs : Floats
        (n, n) cost of going from row to column, 0 to 10¹²; the diagonal is not used.
    precedence : Int32s
        (m, 2) rows (a, b): a somewhere before b. May be redundant.
    time_limit_s : float
        Wall-clock limit, s, preparations included.
    seed : int
        Equal seeds and equal `max_iterations` give equal results, if these end the search.
    max_iterations : int | None
        Limit on partial sequences looked at and moves proposed, of both threads together;
        None: time alone ends the search.
    report : Report
        Told several times a second how the search goes.
    stop : Stop
        Asked several times a second; True ends the search with the best so far.

    Returns
    -------
    SopResult
        The cheapest sequence found, and a bound no sequence is below.

    Raises
    ------
    InputError
        If shapes do not fit, a cost is negative or too large, a node is unknown, a limit is
        negative, or the precedence has a cycle.

    Examples
    --------
    >>> import numpy as np
    >>> from decmcts import solve_sop
    >>> costs = np.array([[0, 1, 9], [9, 0, 9], [2, 9, 0.0]])
    >>> found = solve_sop(costs, np.array([[0, 1]]), time_limit_s=1.0)
    >>> found.order.tolist(), found.cost, found.optimal
    ([2, 0, 1], 3.0, True)
    """
    stopping = Stopping(time_limit_s, max_iterations, stop)
    return search_sop(costs, precedence, stopping=stopping, seed=seed, progress=report)


@checked
def solve_qcsp(
    problem: QcspProblem,
    *,
    time_limit_s: float = 30.0,
    seed: int = 0,
    max_iterations: int | None = None,
    target: float = 0.0,
    report: Report = unheard,
    stop: Stop = never,
) -> QcspResult:
    """Find a schedule of small makespan for cranes on one rail, on two threads.

    Ends early when the result is proven optimal.

    Parameters
    ----------
    problem : QcspProblem
        What `read_qcsp` returned.
    time_limit_s : float
        Wall-clock limit, s.
    seed : int
        Equal seeds and equal `max_iterations` give equal results, if these end the search.
    max_iterations : int | None
        Limit on the moves proposed, of both threads together; None: time alone ends the search.
    target : float
        A makespan that is good enough: the search ends once it is reached.
    report : Report
        Told how the search goes.
    stop : Stop
        Asked many times a second; True ends the search with the best so far.

    Returns
    -------
    QcspResult
        The best schedule found, and a bound no schedule beats.

    Raises
    ------
    InputError
        If a limit is negative.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from decmcts import read_qcsp, solve_qcsp
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "three_tasks.qcsp"
    ...     _ = file.write_text(
    ...         '{"t": 1, "s": 1, "p": [4, 3, 5], "l": [2, 2, 6], "r": [0, 0], "l0": [1, 4], '
    ...         '"Phi": [[1, 2]]}'
    ...     )
    ...     problem = read_qcsp(file)
    >>> solve_qcsp(problem, time_limit_s=1.0, max_iterations=1000).schedule.makespan
    8.0
    """
    stopping = Stopping(time_limit_s, max_iterations, stop)
    return search_qcsp(problem, stopping=stopping, seed=seed, target=target, progress=report)


def compile_qcsp(problem: QcspProblem, stop: Stop) -> None:
    """Search for a few iterations, so that compiling does not count as search time."""
    search_qcsp(problem, stopping=Stopping(iterations=10, asked=stop))


def compile_sop() -> None:
    """Solve a small problem, so that compiling does not count as search time.

    It is large enough that no search proves it optimal at once: all of them are compiled.
    """
    points = np.random.default_rng(0).random((40, 2))
    costs = np.linalg.norm(points[:, None] - points[None, :], axis=2)
    search_sop(costs, np.empty((0, 2), np.int32), stopping=Stopping(iterations=40_000))


def require_sound(instance: SopInstance, found: SopResult) -> None:
    """Raise VerificationError unless the sequence solves the instance at the cost it claims."""
    position = np.empty(len(instance), np.int64)
    position[found.order] = np.arange(len(instance))
    a, b = instance.precedence.T
    cost = float(instance.costs[found.order[:-1], found.order[1:]].sum())
    if not (
        np.array_equal(np.sort(found.order), np.arange(len(instance)))
        and (position[a] < position[b]).all()
        and abs(cost - found.cost) <= 1e-6 * (1.0 + cost)
    ):
        raise VerificationError("the search returned a wrong sequence; nothing was written")
