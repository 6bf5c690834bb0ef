"""The tree search over clusters that a good sequence guides."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from decmcts._kernels.random import seeded
from decmcts._kernels.sequence.tour import respects, tour_cost
from decmcts._kernels.trees.guided import cluster_ranks, explore
from decmcts._kernels.trees.tree import new_tree
from decmcts.search.decomposition.blocks import Sequence
from decmcts.search.decomposition.clustered import clustered_problem, fresh_rollout
from decmcts.search.decomposition.threads import open_threads
from decmcts.search.hybrid.trees import Trees
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.neighbours import near_ports
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping
from tests.search.problems import random_problem
from tests.search.test_planners import cheapest_by_brute_force


def explored(
    problem: OrderProblem, rank: np.ndarray, *, rollouts: int, stray: float, capacity: int = 5000
) -> tuple[float, np.ndarray, np.ndarray]:
    clustered = clustered_problem(problem, np.arange(len(problem), dtype=np.int32))
    rollout, tree = fresh_rollout(clustered), new_tree(capacity)
    order, is_reversed = rollout.order.copy(), rollout.reversed.copy()
    best = explore(
        tree, clustered, rollout, rank[np.argsort(clustered.label)], stray, 0.3, 1.0, rollouts,
        seeded(1), order, is_reversed, np.inf,
    )  # fmt: skip
    return best, order, is_reversed


def test_the_first_rollout_repeats_the_guide() -> None:
    """The search starts from what annealing found, not from a random order."""
    problem = random_problem(4, 25, density=0.1, reversible=0.0)
    _, order, _ = explored(problem, np.arange(25.0), rollouts=1, stray=0.0)
    assert order.tolist() == list(range(25))


def test_its_best_sequence_is_allowed_and_costs_what_it_says() -> None:
    """Annealing starts from it."""
    problem = random_problem(5, 25, density=0.1)
    best, order, is_reversed = explored(problem, np.arange(25.0), rollouts=300, stray=0.1)
    assert respects(order, problem.graph.succ_offsets, problem.graph.succs)
    assert tour_cost(problem.ports(), order, is_reversed) == pytest.approx(best)
    assert best < explored(problem, np.arange(25.0), rollouts=1, stray=0.0)[0]


@pytest.mark.parametrize("seed", range(6))
def test_it_finds_the_optimum_when_every_contour_is_a_cluster(seed: int) -> None:
    """Widening must not shut out any order for ever."""
    problem = random_problem(seed, 6, density=0.3, reversible=0.0)
    best, _, _ = explored(problem, np.arange(6.0), rollouts=20_000, stray=0.2)
    assert best == pytest.approx(cheapest_by_brute_force(problem))


def test_a_full_tree_goes_on() -> None:
    """Memory is bounded; searches are not."""
    problem = random_problem(2, 20, density=0.1)
    few, _, _ = explored(problem, np.arange(20.0), rollouts=2000, stray=0.2, capacity=3)
    assert np.isfinite(few)


def test_ranks_are_mean_positions() -> None:
    """A cluster that is printed in two visits counts as between them."""
    position, label = np.array([0, 3, 1, 2], np.int32), np.array([0, 0, 1, 1], np.int32)
    assert cluster_ranks(position, label, 2).tolist() == [1.5, 1.5]


@pytest.mark.parametrize(
    ("trees", "budget_s", "grown"),
    [
        (Trees(), 60.0, True),
        (Trees(share=0.0), 60.0, False),  # none wanted
        (Trees(share=1e-4), 0.1, False),  # clustering alone would take longer
    ],
)
def test_trees_have_a_turn_where_there_is_time(trees: Trees, budget_s: float, grown: bool) -> None:
    """On dense graphs of short searches clustering would take what annealing needs."""
    problem, clock = random_problem(5, 60, density=0.3), itertools.count(step=0.01)
    incumbent = Incumbent(
        problem,
        clock=lambda: float(next(clock)),
        stopping=Stopping(seconds=budget_s),
    )
    guest = Sequence.best_of(incumbent, near_ports(problem))
    with open_threads(2, 0) as threads:
        for _ in trees.turn(incumbent, threads, guest):
            assert not incumbent.over
    assert (guest.cost < incumbent.source_cost) == grown
