"""Annealing in windows: what a window becomes is kept or put back, and the rest stays."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.feasibility.graph import DependencyGraph
from decmcts.random_kernels import seeded
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping
from decmcts.search.sop import threads
from decmcts.search.sop.annealing import ALL, LubyAnnealer, NearSteps
from decmcts.search.sop.solver import search_sop
from decmcts.search.sop.threads import TwoThreads
from decmcts.search.sop.windows import WindowAnnealer
from tests.search.sop.test_annealing import layered
from tests.search.sop.test_elites import cost_of


def thread(layers: int, contours: int, seed: int) -> tuple[WindowAnnealer, Incumbent]:
    """Return a thread that begins with the nodes by number, and who keeps the best."""
    precedence, costs = layered(layers, contours, seed)
    graph = DependencyGraph.from_pairs(len(costs), precedence.pairs)
    problem = OrderProblem.of_costs(costs, graph)
    incumbent = Incumbent(problem, clock=lambda: 0.0, stopping=Stopping(None, 10), report=None)
    incumbent.offer(np.arange(len(costs), dtype=np.int32), incumbent.reversed)
    steps = NearSteps.of(costs, costs, precedence.possible)
    before = LubyAnnealer(
        bare=steps.bare(costs, graph), state=seeded(seed), scale=steps.scale,
        long=True,
    )  # fmt: skip
    return WindowAnnealer.after(before, incumbent), incumbent


@pytest.mark.parametrize(("layers", "contours"), [(1, 2), (4, 9), (12, 40)])
def test_costs_and_precedence_hold(layers: int, contours: int) -> None:
    windows, incumbent = thread(layers, contours, seed=5)
    began = incumbent.cost
    bare, pairs = windows.bare, layered(layers, contours, seed=5)[0].pairs
    for slice_ in range(20):
        assert windows.work(7_777, slice_ / 60) >= 7_777
        assert windows.cost == pytest.approx(cost_of(bare.costs, bare.order), abs=1e-6)
        assert sorted(bare.order) == list(range(len(bare.order)))
        np.testing.assert_array_equal(bare.position[bare.order], np.arange(len(bare.order)))
        assert (bare.position[pairs[:, 0]] < bare.position[pairs[:, 1]]).all()
        windows.meet(incumbent)
    assert incumbent.cost == pytest.approx(windows.best)
    assert incumbent.cost < (0.9 if contours > 2 else 1.1) * began
    assert incumbent.cost == pytest.approx(cost_of(bare.costs, incumbent.order))


def test_when_cold_no_worse_window_is_kept() -> None:
    windows, _ = thread(6, 20, seed=1)
    ends = []
    for _ in range(100):
        windows.work(20_000, 1.0)
        ends.append(windows.cost)
    assert ends == sorted(ends, reverse=True)
    assert ends[-1] < ends[0]


def test_a_thread_far_behind_goes_on_from_the_incumbent() -> None:
    ahead, incumbent = thread(6, 20, seed=1)
    behind, _ = thread(6, 20, seed=1)
    for _ in range(100):
        ahead.work(20_000, 0.9)
    ahead.meet(incumbent)
    behind.work(777, 0.9)
    behind.meet(incumbent)
    np.testing.assert_array_equal(behind.bare.order, incumbent.order)
    behind.work(777, 0.9)
    bare = behind.bare
    assert behind.cost == pytest.approx(cost_of(bare.costs, bare.order))


@pytest.mark.long
def test_windows_after_a_long_annealing_find_more_than_a_longer_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where costs are distances: 9 734 and 9 816 in all."""

    monkeypatch.setattr(TwoThreads, "_beams", lambda self: self._annealer(1))

    def found() -> float:
        total = 0.0
        for seed in range(2):
            precedence, costs = layered(10, 40, seed=3 + seed)
            stopping = Stopping(None, 20_000_000)
            total += search_sop(costs, precedence.pairs, stopping=stopping, seed=seed).cost
        return total

    in_windows = found()
    monkeypatch.setattr(threads, "_BEFORE_WINDOWS", ALL)
    monkeypatch.setattr(TwoThreads, "_in_windows", lambda self, thread: thread)
    assert in_windows < found()
