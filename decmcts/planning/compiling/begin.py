"""Begins a search: what it needs is compiled first, or another planner begins meanwhile."""

from __future__ import annotations

from dataclasses import replace

from decmcts._kernels.exact.ideals import WINDOW
from decmcts.planning.compiling.child import compiled_beside
from decmcts.planning.compiling.parts import FIRST, is_compiled, mark_compiled, part_of
from decmcts.planning.compiling.rows import row_of
from decmcts.planning.events import Stop, never
from decmcts.search.meanwhile import Meanwhile
from decmcts.search.planners import PLANNERS, Planner, plan_order
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping
from decmcts.search.sequence.timed_lags import no_timed_lags


def compile_search(problem: OrderProblem, planner: str | Planner, stop: Stop = never) -> None:
    """Search problems of no size just long enough to need every kernel, off the clock.

    One solved exactly, one by starts and what joins them, one that must cool; none
    once `stop` says so.
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


def begin_with(problem: OrderProblem, planner: str | Planner, stop: Stop) -> str | Planner:
    """Compile what a search needs; return the planner to begin with.

    That is another one while the kernels of `hybrid` are still compiled beside this process,
    and none that searches once `stop` says so. One of a user's own begins as it is.
    """
    if not isinstance(planner, str):
        return "slicer" if stop() else planner
    first = first_planner(problem, planner)
    compile_search(problem, first, stop)
    if stop():
        return "slicer"
    if first == planner:
        return planner
    part = part_of(problem, planner)
    return Meanwhile(PLANNERS[first], PLANNERS[planner], lambda: is_compiled(part))


def can_begin(problem: OrderProblem, planner: str | Planner) -> bool:
    """Say whether what a search begins with is compiled."""
    if not isinstance(planner, str):
        return True
    return is_compiled(part_of(problem, first_planner(problem, planner)))


def first_planner(problem: OrderProblem, planner: str) -> str:
    """Name the planner a search begins with while other kernels are compiled beside it."""
    part = part_of(problem, planner)
    waits = planner == "hybrid" and compiled_beside(part) and not is_compiled(part)
    return FIRST if waits else planner
