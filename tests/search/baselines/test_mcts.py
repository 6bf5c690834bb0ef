"""The paper's tree search: its bookkeeping, its clusters, its optimum on small prints."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decmcts.random_kernels import seeded
from decmcts.search.baselines.mcts import clustered_problem, fresh_rollout
from decmcts.search.baselines.mcts_kernels import (
    NO_NODE,
    ROOT,
    new_tree,
    select,
    simulate,
    simulate_many,
)
from decmcts.search.sequence.metric_kernels import longest_hop, respects
from tests.search.problems import random_problem, tour_cost


@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 25),
    clusters=st.integers(1, 10),
    nearest=st.sampled_from([0.0, 0.5, 1.0]),
)
@settings(max_examples=50, deadline=None)
def test_every_rollout_is_feasible_and_priced_right(
    seed: int, n: int, clusters: int, nearest: float
) -> None:
    """Any rollout may become the plan, whatever the clustering."""
    problem = random_problem(seed, n, density=0.15)
    labels = np.random.default_rng(seed).integers(0, clusters, n).astype(np.int32)
    clustered = clustered_problem(problem, labels)
    rollout, state, tree = fresh_rollout(clustered), seeded(seed), new_tree(64)
    tried = np.zeros(len(clustered.outer_preds), np.bool_)
    for _ in range(10):
        simulate(tree, clustered, rollout, tried, state, 1.0, 100.0, nearest)
        assert respects(rollout.order, problem.graph.succ_offsets, problem.graph.succs)
        cost = tour_cost(clustered.metric, rollout.order, rollout.reversed)
        assert rollout.travel[0] == pytest.approx(cost)
        blocks = [h for h, _ in itertools.groupby(clustered.label[rollout.order].tolist())]
        assert len(blocks) == len(set(blocks))
    assert not tried.any()


def test_a_nearest_rollout_goes_on_with_the_nearest_cluster() -> None:
    """Then a rollout is a greedy tour from where the tree leaves off."""
    problem = random_problem(6, 12, density=0.1)
    clustered = clustered_problem(problem, np.arange(12, dtype=np.int32))
    rollout, tried = fresh_rollout(clustered), np.zeros(12, np.bool_)
    simulate(new_tree(1), clustered, rollout, tried, seeded(2), 1.0, 100.0, 1.0)
    done = {int(rollout.order[0])}
    for a, b in itertools.pairwise(rollout.order.tolist()):
        at = problem.start[a] if rollout.reversed[a] else problem.end[a]
        reached = problem.start[b] if not rollout.reversed[b] else problem.end[b]
        waits = {after for before, after in problem.graph.pairs().tolist() if before not in done}
        ready = [c for c in range(12) if c not in done and c not in waits]
        ends = [problem.start[c] for c in ready]
        ends += [problem.end[c] for c in ready if problem.reversible[c]]
        nearest = min(float(np.linalg.norm(at - end)) for end in ends)
        assert np.linalg.norm(at - reached) == pytest.approx(nearest)
        done.add(b)


def test_visits_and_rewards_add_up() -> None:
    """A parent has seen what its children have seen, plus the rollout that made it."""
    problem = random_problem(4, 12, density=0.1)
    clustered = clustered_problem(problem, np.arange(12, dtype=np.int32))
    rollout, tried = fresh_rollout(clustered), np.zeros(12, np.bool_)
    longest = 12 * longest_hop(clustered.metric, clustered.reversible)
    tree, state = new_tree(2000), seeded(1)
    for _ in range(500):
        simulate(tree, clustered, rollout, tried, state, 1.4, longest, 0.0)
    size = int(tree.size[0])
    assert tree.visits[ROOT] == 500
    assert (tree.reward[:size] >= 0).all()
    assert (tree.reward[:size] <= tree.visits[:size]).all()
    below = np.bincount(tree.parent[1:size], weights=tree.visits[1:size], minlength=size)
    inner = below > 0
    own = tree.visits[:size] - below
    assert (own[inner] == np.where(np.flatnonzero(inner) == ROOT, 0, 1)).all()


def test_selection_is_ucb1() -> None:
    """The tree policy is the paper's, not a look-alike."""
    tree = new_tree(3)
    tree.first_child[ROOT], tree.sibling[1], tree.sibling[2] = 1, 2, NO_NODE
    tree.visits[:3] = 100, 90, 10
    tree.reward[:3] = 60.0, 55.0, 5.0
    assert select(tree, ROOT, 0.0) == 1
    assert select(tree, ROOT, 1.0) == 2


def test_circular_clusters_become_one() -> None:
    """Clusters that wait for each other can never be printed one after the other."""
    problem = random_problem(1, 6, density=1.0)
    clustered = clustered_problem(problem, np.array([0, 1, 0, 2, 3, 3], np.int32))
    assert len(set(clustered.label[:3].tolist())) == 1
    assert len(set(clustered.label.tolist())) == 3


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(2, 15))
@settings(max_examples=50, deadline=None)
def test_longest_hop_is_the_longest(seed: int, n: int) -> None:
    """Rewards leave 0..1 when the longest travel is underrated."""
    problem = random_problem(seed, n)
    longest = 0.0
    for a, b in itertools.permutations(range(n), 2):
        outs = [problem.end[a], *([problem.start[a]] if problem.reversible[a] else [])]
        ins = [problem.start[b], *([problem.end[b]] if problem.reversible[b] else [])]
        longest = max(longest, *(float(np.linalg.norm(o - i)) for o in outs for i in ins))
    assert longest_hop(problem.ports(), problem.reversible) == pytest.approx(longest)


def test_a_full_tree_goes_on() -> None:
    """Long searches must not write past the arrays."""
    problem = random_problem(2, 10, density=0.0)
    clustered = clustered_problem(problem, np.arange(10, dtype=np.int32))
    rollout, tree = fresh_rollout(clustered), new_tree(5)
    best = simulate_many(
        tree, clustered, rollout, np.zeros(10, np.bool_), seeded(1), 1.4, 100.0, 0.0, 200,
        rollout.order.copy(), rollout.reversed.copy(), np.inf,
    )  # fmt: skip
    assert np.isfinite(best)
    assert tree.size[0] == 5
    assert tree.visits[ROOT] == 200
