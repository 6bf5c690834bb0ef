"""Two threads anneal one sequence, each on its side of a cut."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from decmcts.feasibility.graph import DependencyGraph
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping
from decmcts.search.sop import threads
from decmcts.search.sop.annealing import NearSteps
from decmcts.search.sop.joint import JointAnnealing
from decmcts.search.sop.solver import search_sop
from tests.search.sop.test_annealing import layered
from tests.search.sop.test_elites import cost_of


def test_costs_and_precedence_hold_while_both_threads_work() -> None:
    precedence, costs = layered(12, 40, seed=5)
    graph = DependencyGraph.from_pairs(len(costs), precedence.pairs)
    problem = OrderProblem.of_costs(costs, graph)
    incumbent = Incumbent(problem, clock=lambda: 0.0, stopping=Stopping(None, 10), report=None)
    incumbent.offer(np.arange(len(costs), dtype=np.int32), incumbent.reversed)
    began = incumbent.cost
    steps = NearSteps.of(costs, costs, precedence.possible)
    joint = JointAnnealing.of(
        steps.bare(costs, graph), scale=steps.scale, seed=1, incumbent=incumbent
    )
    sides = joint.sides
    order, pairs = joint.bare.order, precedence.pairs
    with ThreadPoolExecutor(2) as pool:
        for slice_ in range(40):  # windows from the 28th on
            made = list(pool.map(lambda side, k=slice_: side.work(30_000, k / 40), sides))
            assert min(made) >= 30_000
            for side in sides:
                side.meet(incumbent)
            assert joint.cost == pytest.approx(cost_of(costs, order), abs=1e-6)
            position = joint.bare.position
            np.testing.assert_array_equal(position[order], np.arange(len(order)))
            assert (position[pairs[:, 0]] < position[pairs[:, 1]]).all()
            assert sides[0].last == sides[1].first
    assert incumbent.cost < 0.9 * began
    assert incumbent.cost == pytest.approx(cost_of(costs, incumbent.order))


def test_large_problems_of_distances_are_annealed_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """Equal seeds give equal results, and a better one than beams in as many iterations."""
    precedence, costs = layered(12, 40, seed=3)

    def found(*, large: int) -> float:
        monkeypatch.setattr(threads, "_LARGEST_TREE", large)
        stopping = Stopping(None, 8_000_000)
        return search_sop(costs, precedence.pairs, stopping=stopping, seed=2).cost

    assert found(large=100) == found(large=100) < found(large=1000)
