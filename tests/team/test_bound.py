"""The makespan bound: a bound on every plan, and exact where that is easy to see."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

from decmcts._kernels.bound import chain_behind, longest_chain
from decmcts.feasibility.graph import DependencyGraph
from decmcts.team.bound import makespan_bound
from decmcts.team.problem import build_team_problem
from decmcts.team.rail_bound import Held, rail_bound
from decmcts.team.resolve import resolve


def _listed(low: np.ndarray, high: np.ndarray, seconds: np.ndarray, gap: float, n: int) -> float:
    """The same programme with every set of pieces that n heads can print at once listed."""
    pieces = range(len(low))
    ordered = sorted(pieces, key=lambda i: (low[i], high[i]))
    sets = [
        chosen
        for size in range(1, n + 1)
        for chosen in combinations(ordered, size)
        if all(high[i] + gap <= low[j] for i, j in pairwise(chosen))
    ]
    held = np.array([[float(i in chosen) for i in pieces] for chosen in sets])
    return float(-linprog(-seconds, A_ub=held, b_ub=np.ones(len(sets))).fun)


@pytest.mark.parametrize("heads", [2, 3, 4])
@pytest.mark.parametrize("seed", range(5))
def test_the_programme_of_chains_is_that_of_all_sets(seed: int, heads: int) -> None:
    """Rounding to cells lets heads fit more easily, so it can only take a little away."""
    rng = np.random.default_rng(seed)
    low = rng.uniform(0, 100, 9)
    high, seconds = low + rng.uniform(0, 20, 9), rng.uniform(1, 5, 9)
    held = Held(low, high, seconds, 2 * np.arange(9))
    found = rail_bound(held, separation_mm=24.0, heads=heads)
    listed = _listed(low, high, seconds, 24.0, heads)
    assert 0.85 * listed <= found <= listed * (1 + 1e-9)


def test_the_way_that_is_worth_less_counts() -> None:
    """A contour that may run either way is only worth what its cheaper way is."""
    one_way = Held(
        *np.array([[0.0, 60.0, 0.0], [60.0, 60.0, 0.0], [5.0, 1.0, 9.0]]), np.array([0, 0, 2])
    )
    either = Held(
        np.append(one_way.low, 0.0), np.append(one_way.high, 0.0),
        np.append(one_way.seconds, 6.0), np.append(one_way.way, 1),
    )  # fmt: skip
    bounds = [rail_bound(held, separation_mm=50.0, heads=2) for held in (one_way, either)]
    assert bounds[0] == pytest.approx(15.0 - 1.0, rel=0.02) and bounds[1] <= bounds[0] + 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_no_plan_is_faster_than_the_bound(case: Callable[..., Any], seed: int) -> None:
    """A bound that a plan beats would be a lie in every report."""
    chosen = case(seed, towers=8)
    problem = build_team_problem(chosen.job, chosen.machine, chosen.graph)
    bound = makespan_bound(chosen.job, chosen.machine, chosen.graph)
    assert resolve(problem, {}, [0, 1]).makespan_s >= bound.bound_s
    assert 0.5 - 1e-5 <= bound.bound_s / bound.serial_s <= 1.0


def test_all_in_one_place_is_serial(case_of: Callable[..., Any]) -> None:
    """Contours that all conflict leave nothing to share."""
    chosen = case_of([(50, 10, 0.5), (60, 10, 0.5)], [(50, 20, 0.5), (60, 20, 0.5)])
    bound = makespan_bound(chosen.job, chosen.machine, chosen.graph)
    assert bound.bound_s == pytest.approx(bound.serial_s, rel=1e-5)


def test_far_apart_is_twice_as_fast(case_of: Callable[..., Any]) -> None:
    """Two equal strokes far apart take half the time."""
    chosen = case_of([(20, 10, 0.5), (30, 10, 0.5)], [(90, 20, 0.5), (100, 20, 0.5)])
    bound = makespan_bound(chosen.job, chosen.machine, chosen.graph)
    assert bound.bound_s == pytest.approx(bound.serial_s / 2.0, rel=1e-5)


def test_what_only_one_head_reaches_bounds_too(case_of: Callable[..., Any]) -> None:
    """Both strokes lie beyond the left head's reach: no help from it."""
    chosen = case_of([(111, 10, 0.5), (119, 10, 0.5)], [(111, 50, 0.5), (119, 50, 0.5)])
    bound = makespan_bound(chosen.job, chosen.machine, chosen.graph)
    assert bound.exclusive_s == pytest.approx(bound.serial_s)


def test_longest_chain_and_chain_behind() -> None:
    """A chain bounds whatever the heads do; the chain behind steers who goes first."""
    graph = DependencyGraph.from_pairs(5, np.array([[0, 1], [1, 3], [0, 2], [2, 3]]))
    seconds = np.array([1.0, 5.0, 2.0, 4.0, 7.0])
    assert longest_chain(seconds, graph.pred_offsets, graph.preds) == 10.0
    behind = chain_behind(seconds, graph.succ_offsets, graph.succs)
    assert behind.tolist() == [10.0, 9.0, 6.0, 4.0, 7.0]
