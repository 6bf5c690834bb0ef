"""Compiling what a search needs before it begins, or letting another planner begin meanwhile.

Searching tiny problems compiles the kernels that a real search needs.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from decmcts.feasibility.graph import DependencyGraph
from decmcts.planning.compiling.child import compiled_beside
from decmcts.planning.compiling.parts import FIRST, is_compiled, mark_compiled, part_of
from decmcts.planning.events import Stop, never
from decmcts.search.bounds.ideals_kernels import WINDOW
from decmcts.search.planners import PLANNERS, Meanwhile, plan_order
from decmcts.search.sequence.planner import Planner
from decmcts.search.sequence.problem import OrderProblem, Seams
from decmcts.search.sequence.stopping import Stopping
from decmcts.search.sequence.timed_lags import no_timed_lags


def compile_search(problem: OrderProblem, planner: str | Planner, stop: Stop = never) -> None:
    """Search tiny problems, so that the planner's kernels are compiled before its clock starts.

    Each needs other kernels: the first is solved exactly, the second is too large for that
    and is annealed, the third has timed lags. Ends early once `stop` returns True.
    """
    ahead = ((3, None, 100), (2 * WINDOW, None, 500), (3, no_timed_lags(3), 100))
    for n, timed_lags, iterations in ahead:
        if stop():
            return
        row = row_of(n, loops=problem.seams is not None)
        small = replace(row, pace=problem.pace, timed_lags=timed_lags)
        plan_order(
            small, planner=planner, stopping=Stopping(iterations=iterations, asked=stop), seed=0,
        )  # fmt: skip
    if isinstance(planner, str) and not stop():
        mark_compiled(part_of(problem, planner))


def begin_with(
    problem: OrderProblem, planner: str | Planner, stop: Stop, *, at_once: bool
) -> str | Planner:
    """Compile what a search needs; return the planner to begin with.

    While the kernels of `hybrid` are still being compiled in another process, that is one which
    begins with `FIRST` and changes over when they are ready, but not `at_once`. Once `stop`
    returns True it is `slicer`, which does not search. A user's own planner is returned as it is.
    """
    if not isinstance(planner, str):
        return "slicer" if stop() else planner
    first = first_planner(problem, planner, at_once=at_once)
    compile_search(problem, first, stop)
    if stop():
        return "slicer"
    if first == planner:
        return planner
    part = part_of(problem, planner)
    return Meanwhile(PLANNERS[first], PLANNERS[planner], lambda: is_compiled(part))


def can_begin(problem: OrderProblem, planner: str | Planner, *, at_once: bool) -> bool:
    """Say whether what a search begins with is compiled."""
    if not isinstance(planner, str):
        return True
    return is_compiled(part_of(problem, first_planner(problem, planner, at_once=at_once)))


def first_planner(problem: OrderProblem, planner: str, *, at_once: bool) -> str:
    """Name the planner a search begins with while other kernels are compiled beside it.

    `at_once` it is the planner itself: then results repeat, whatever is compiled.
    """
    if at_once or planner != "hybrid":
        return planner
    part = part_of(problem, planner)
    return FIRST if compiled_beside(part) and not is_compiled(part) else planner


def row_of(n: int, *, loops: bool = False) -> OrderProblem:
    """Return `n` contours in a row; the last one lies above and depends on the first.

    With `loops` each may be entered at either of its two ends.
    """
    start = np.zeros((n, 3))
    start[:, 0] = np.arange(n)
    start[-1, 2] = 0.2
    graph = DependencyGraph.from_pairs(n, np.array([[0, n - 1]], np.int32))
    layer = (start[:, 2] > 0.0).astype(np.int32)
    end, either = start[::-1].copy(), np.ones(n, np.bool_)
    if not loops:
        return OrderProblem(start, end, either, layer, graph)
    ends = np.stack([start, end], axis=1).reshape(-1, 3)
    seams = Seams(2 * np.arange(n + 1), ends, ends.copy(), np.tile([0, 1], n).astype(np.int32))
    return OrderProblem(start, start.copy(), ~either, layer, graph, seams=seams)
