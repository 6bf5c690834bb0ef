"""The discounted tree against the formulas written out."""

from __future__ import annotations

import math

import numpy as np
import pytest

from decmcts.team.dec_mcts.tree import Tree


def _plan(k: int) -> np.ndarray:
    return np.array([k], np.int32)


def _slow_bounds(
    rewards: list[tuple[int, float]], arms: int, gamma: float, c: float
) -> list[float]:
    """U of each arm from the whole history: F and t are sums over all samples."""
    now = len(rewards)
    weight, total = [0.0] * arms, [0.0] * arms
    for u, (arm, reward) in enumerate(rewards, start=1):
        weight[arm] += gamma ** (now - u)
        total[arm] += gamma ** (now - u) * reward
    log = max(math.log(max(sum(weight), 1.0)), 0.0)
    return [t / w + 2 * c * math.sqrt(log / w) for t, w in zip(total, weight, strict=True)]


@pytest.mark.parametrize("seed", range(5))
def test_selection_is_the_discounted_bound(seed: int) -> None:
    """Lazy discounting must choose what the sums over the whole history choose."""
    rng = np.random.default_rng(seed)
    gamma, c, arms = 0.8, 0.5, 4
    tree = Tree(_plan(9), gamma=gamma, exploration=c)
    nodes = [tree.expand(tree.root, _plan(k)) for k in range(arms)]
    history = []
    for k in [*range(arms), *rng.integers(arms, size=30).tolist()]:
        reward = float(rng.random())
        tree.backup(nodes[k], reward)
        history.append((k, reward))
        if len(history) >= arms:
            bounds = _slow_bounds(history, arms, gamma, c)
            assert tree.select(tree.root) is nodes[int(np.argmax(bounds))]


def test_old_rewards_fade() -> None:
    """Peers change their plans: what was good once must not stay good for ever."""
    tree = Tree(_plan(0), gamma=0.5, exploration=0.4)
    good, bad = tree.expand(tree.root, _plan(1)), tree.expand(tree.root, _plan(2))
    for _ in range(5):
        tree.backup(good, 1.0)
        tree.backup(bad, 0.4)
    for _ in range(8):
        tree.backup(good, 0.0)
        tree.backup(bad, 0.4)
    assert [int(p[0]) for p in tree.best_plans(2)] == [2, 1]


def test_seen_often_means_more_children() -> None:
    """Progressive widening: about the square root of the visits."""
    tree = Tree(_plan(0), gamma=0.9, exploration=0.7)
    for k in range(60):
        tree.backup(tree.expand(tree.descend(), _plan(k + 1)), 0.5)
    assert 7 <= len(tree.root.children) <= 9


def test_best_plans_are_different() -> None:
    """X̂ with the same plan ten times would tell the others nothing."""
    tree = Tree(_plan(0), gamma=0.9, exploration=0.7)
    for k in range(6):
        tree.backup(tree.expand(tree.root, _plan(k % 2)), 0.5)
    assert sorted(int(p[0]) for p in tree.best_plans(10)) == [0, 1]


def test_a_new_tree_offers_its_root() -> None:
    """Before the first sample the default is the plan."""
    assert Tree(_plan(3), gamma=0.9, exploration=0.7).best_plans(10)[0][0] == 3
