"""The makespan bound: a bound on every plan, and exact where that is easy to see."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

from decmcts._kernels.bound import chain_behind, longest_chain
from decmcts.feasibility.graph import DependencyGraph
from decmcts.team.bound import makespan_bound
from decmcts.team.pairing import _classes, _pair_boxes, pair_work
from decmcts.team.problem import build_team_problem
from decmcts.team.resolve import resolve
from decmcts.team.space import build_space


def _slow_matching(boxes: np.ndarray, seconds: np.ndarray, gap: float) -> float:
    """Maximum fractional matching by listing every pair."""
    n = len(boxes)
    pairs = [(u, v) for u in range(n) for v in range(n) if boxes[u, 1] + gap <= boxes[v, 0]]
    if not pairs:
        return 0.0
    uses = np.zeros((n, len(pairs)))
    for k, (u, v) in enumerate(pairs):
        uses[u, k] += 1
        uses[v, k] += 1
    return float(-linprog(-np.ones(len(pairs)), A_ub=uses, b_ub=seconds).fun)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_rail_matching_is_the_largest(case: Callable[..., Any], seed: int) -> None:
    """The chain of cells solves the pair programme; shrinking boxes can only add a little."""
    chosen = case(seed, towers=8, layers=1)
    space = build_space(chosen.job, chosen.machine)
    seconds = np.random.default_rng(seed).uniform(1, 5, len(space.boxes))
    everyone = space.eligible | True
    space = type(space)(space.boxes.round(), space.gaps, space.parks, everyone)
    slow = _slow_matching(space.boxes, seconds, float(space.gaps[0, 1, 0]))
    assert pair_work(seconds, space).shared_s == pytest.approx(slow)
    classes, place = _classes(space, 1.0)
    assert _pair_boxes(classes, place, seconds, space.gaps[0, 1]).shared_s == pytest.approx(slow)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_no_plan_is_faster_than_the_bound(case: Callable[..., Any], seed: int) -> None:
    """A bound that a plan beats would be a lie in every report."""
    chosen = case(seed, towers=8)
    problem = build_team_problem(chosen.job, chosen.machine, chosen.graph)
    bound = makespan_bound(chosen.job, chosen.machine, chosen.graph)
    assert resolve(problem, {}, [0, 1]).makespan_s >= bound.bound_s
    assert 1.0 <= bound.speedup <= 2.0 + 1e-5


def test_all_in_one_place_is_serial(case_of: Callable[..., Any]) -> None:
    """Contours that all conflict leave nothing to share."""
    chosen = case_of([(50, 10, 0.5), (60, 10, 0.5)], [(50, 20, 0.5), (60, 20, 0.5)])
    bound = makespan_bound(chosen.job, chosen.machine, chosen.graph)
    assert bound.overlap_s == 0.0
    assert bound.bound_s == pytest.approx(bound.serial_s, rel=1e-5)


def test_far_apart_is_twice_as_fast(case_of: Callable[..., Any]) -> None:
    """Two equal strokes far apart take half the time."""
    chosen = case_of([(20, 10, 0.5), (30, 10, 0.5)], [(90, 20, 0.5), (100, 20, 0.5)])
    bound = makespan_bound(chosen.job, chosen.machine, chosen.graph)
    assert bound.speedup == pytest.approx(2.0, rel=1e-5)


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
