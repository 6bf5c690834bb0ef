"""The planner `hybrid`: what its phases begin with, and what it says."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest

from decmcts.feasibility.graph import DependencyGraph
from decmcts.search.hybrid.multistart import Multistart
from decmcts.search.hybrid.phases import Exact, Hybrid
from decmcts.search.hybrid.search import HybridSearch, SearchPhase
from decmcts.search.planners import SearchResult, plan_order
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping
from tests.search.problems import random_problem, with_loops


def repeatable(problem: OrderProblem, *, iterations: int) -> SearchResult:
    return plan_order(problem, planner="hybrid", stopping=Stopping(iterations=iterations), seed=1)


@pytest.mark.slow
@pytest.mark.parametrize("n", [300, 900, 1200])
@pytest.mark.parametrize("loops", [False, True])
def test_threads_do_not_make_hybrid_unrepeatable(n: int, loops: bool) -> None:
    """Two threads share the work; which is faster must not matter. 1200 contours are cut."""
    problem = random_problem(5, n, density=0.01)
    problem = with_loops(problem, 5) if loops else problem
    first = repeatable(problem, iterations=400_000)
    second = repeatable(problem, iterations=400_000)
    assert (first.toolpath.order == second.toolpath.order).all()
    assert (first.history[:, 1:] == second.history[:, 1:]).all()
    assert first.cost < 0.8 * first.source_cost


@pytest.mark.parametrize("always", [10, 100])
def test_hybrid_stops_where_no_travel_is_left(always: int) -> None:
    """Annealing may reach zero where greedy does not; there is no heat below it."""
    start, end = np.zeros((60, 3)), np.zeros((60, 3))
    start[30:, 0] = end[30:, 0] = end[0, 0] = 10.0  # 0 leads from one spot to the other
    graph = DependencyGraph.from_pairs(60, np.empty((0, 2), np.int32))
    problem = OrderProblem(start, end, np.zeros(60, np.bool_), np.zeros(60, np.int32), graph)
    result = plan_order(
        problem,
        planner=Hybrid(multistart=Multistart(always=always)),
        stopping=Stopping(iterations=100_000),
        seed=0,
    )
    assert result.cost == 0.0
    assert result.iterations < 100_000


def test_phases_follow_one_another_and_the_first_that_ends_the_search_is_the_last() -> None:
    """A phase need not ask whether to go on: the loop does, wherever it yields."""
    made: list[str] = []

    @dataclass(frozen=True)
    class Told:
        name: str
        steps: int = 1

        def run(self, search: HybridSearch) -> Iterator[None]:
            for _ in range(self.steps):
                made.append(self.name)
                search.incumbent.tick(1)
                yield

    class Three(Hybrid):
        def phases(self, search: HybridSearch) -> Iterator[SearchPhase]:
            yield from (Told("one"), Told("two", 5), Told("three"))

    plan_order(random_problem(1, 9), planner=Three(), stopping=Stopping(iterations=3), seed=0)
    assert made == ["one", "two", "two"]


@pytest.mark.parametrize(
    ("always", "expected"),
    [
        (1000, "Starts Exact LayeredStart Multistart Windows Descent"),
        (1, "Starts Exact LayeredStart Partition Descent"),
    ],
)
def test_size_and_time_choose_the_phases(always: int, expected: str) -> None:
    """What is not worth its time is not begun."""
    begun: list[str] = []

    class Noted(Hybrid):
        def phases(self, search: HybridSearch) -> Iterator[SearchPhase]:
            for phase in Hybrid.phases(self, search):
                begun.append(type(phase).__name__)
                yield phase

    planner = Noted(exact=Exact(probe=0.0), multistart=Multistart(always=always, at_most=1))
    problem = random_problem(5, 60, density=0.05)
    plan_order(problem, planner=planner, stopping=Stopping(iterations=60_000), seed=0)
    assert " ".join(begun) == expected
