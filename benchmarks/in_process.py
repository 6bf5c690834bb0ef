"""Searches inside the benchmark's own process, for what the command line does not tell.

That is the cost over time and iterations, and planners with parts left out.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

from common import print_path

from decmcts.planning.one_head.order_search import compile_search
from decmcts.planning.options import NO_QUALITY, Freedom, PlannerName, ProcessOrder, Search
from decmcts.planning.problem.print_problem import PrintProblem, load
from decmcts.search.planners import SearchResult, plan_order
from decmcts.search.sequence.planner import Planner
from decmcts.search.sequence.stopping import Stopping


@lru_cache(maxsize=1)
def loaded(model: str, machine: str, process: str) -> PrintProblem:
    """Return a print with its graph, quality rules left out."""
    rules = replace(NO_QUALITY, process_order=ProcessOrder(process))
    return load(print_path(model), machine, rules)


def freed(problem: PrintProblem, freedom: str) -> PrintProblem:
    """Return a problem with another freedom on the graph it has."""
    return replace(problem, rules=replace(problem.rules, freedom=Freedom(freedom)))


def named(planner: str | Planner) -> PlannerName | Planner:
    """Return a planner by its name, or as it is."""
    return PlannerName(planner) if isinstance(planner, str) else planner


def searched(
    model: str,
    machine: str,
    process: str,
    freedom: str,
    planner: str | Planner,
    *,
    limit_s: float,
    seed: int,
    clock: Callable[[], float] = time.monotonic,
) -> tuple[PrintProblem, SearchResult]:
    """Search as `decmcts plan` does; compiling and reading are off the clock."""
    prepared = freed(loaded(model, machine, process), freedom)
    search = Search(limit_s, seed, named(planner))
    problem = prepared.for_one_head(search.objective)
    compile_search(problem, search.planner)
    stopping = Stopping(search.time_limit_s)
    found = plan_order(problem, planner=search.planner, seed=seed, clock=clock, stopping=stopping)
    return prepared, found


def less_percent(result: SearchResult) -> float:
    """Return the reduction of travel against the source, in per cent."""
    return 100 * (1 - result.cost / result.source_cost) if result.source_cost else 0.0
