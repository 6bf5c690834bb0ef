"""Begins a search: what it needs is compiled first, or another planner begins meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from decmcts._kernels.ideals import WINDOW
from decmcts.cli.ahead import FIRST, compiled_beside, is_compiled, mark_compiled, part_of
from decmcts.cli.bound import row_of
from decmcts.search.meanwhile import Meanwhile
from decmcts.search.planners import PLANNERS, Planner, plan_order
from decmcts.search.problem import OrderProblem
from decmcts.search.spacing import no_spacing

COMPILING_S = 3600.0  # more than all kernels take on the slowest machine


def compile_search(
    problem: OrderProblem, planner: str | Planner, stop: Callable[[], bool] = lambda: False
) -> None:
    """Search problems of no size just long enough to need every kernel, off the clock.

    One solved exactly, one by trees, races and what joins them, one that must cool; none
    once `stop` says so.
    """
    ahead = ((3, None, 100), (2 * WINDOW, None, 500), (3, no_spacing(3), 100))
    for n, spacing, iterations in ahead:
        if stop():
            return
        row = row_of(n, loops=problem.seams is not None)
        small = replace(row, pace=problem.pace, spacing=spacing)
        plan_order(
            small, planner=planner, time_limit_s=COMPILING_S, seed=0, max_iterations=iterations,
            stop=stop,
        )  # fmt: skip
    if isinstance(planner, str) and not stop():
        mark_compiled(part_of(problem, planner))


def begin_with(problem: OrderProblem, planner: str, stop: Callable[[], bool]) -> str | Planner:
    """Compile what a search needs; return the planner to begin with.

    That is another one while the kernels of `hybrid` are still compiled beside this process,
    and none that searches once `stop` says so.
    """
    part = part_of(problem, planner)
    if planner != "hybrid" or is_compiled(part) or not compiled_beside(part):
        compile_search(problem, planner, stop)
        return "slicer" if stop() else planner
    compile_search(problem, FIRST, stop)
    if stop():
        return "slicer"
    return Meanwhile(PLANNERS[FIRST], PLANNERS[planner], lambda: is_compiled(part))
