"""A head's D-UCT tree over its own plans, as a struct of arrays.

D-UCT goes down the tree by the largest upper confidence bound, in which old
rewards count less (discounted), since the other heads' plans change meanwhile.

A node is a whole plan. A child is its parent's plan after one exchange: another
policy, or some macro-actions sooner or later (Fu, Qiu & Zha 2021 search complete
tours the same way). A node that has been seen often gets more children
(progressive widening). Only the arithmetic of selection is
compiled (`decmcts._kernels.trees.dmcts`): one sample costs a whole rollout.

With `boltzmann` children are drawn by a Boltzmann policy instead. The policy
that makes Σ π·F + τ·H(π) largest is π ∝ exp(F / τ), so τ is the weight of an entropy bonus;
it falls with the visits N as (1 + N)^-decay.

References
----------
Best et al. 2019, Sec. 4.3 (D-UCT); Nguyen et al. 2026, "Boltzmann-based Exploration for
Robust Decentralized Multi-Agent Planning" (CB-MCTS), arXiv 2603.02154.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.trees.dmcts import select_child

ROOT = 0
NONE = -1


@dataclass(frozen=True, slots=True)
class Boltzmann:
    """Draws children by exp(F / τ), τ = temperature·(1 + N)^-decay."""

    temperature: float
    decay: float
    rng: np.random.Generator

    def draw(self, values: NDArray[np.float64], visits: int) -> int:
        """Return a row of `values`, of a node seen so often."""
        tau = self.temperature * (1.0 + visits) ** -self.decay
        weights = np.exp((values - values.max()) / max(tau, 1e-9))
        return int(self.rng.choice(len(weights), p=weights / weights.sum()))


class Tree:
    """The tree; grows in place."""

    def __init__(
        self,
        root: NDArray[np.int32],
        *,
        gamma: float,
        exploration: float,
        boltzmann: Boltzmann | None = None,
    ) -> None:
        self.gamma, self.exploration = gamma, exploration
        self._boltzmann = boltzmann
        self.plans: list[NDArray[np.int32]] = [root]
        self._parent = np.full(1, NONE, np.int32)  # (room,)
        self._first_child = np.full(1, NONE, np.int32)
        self._sibling = np.full(1, NONE, np.int32)
        self._weight = np.zeros(1)  # discounted visits as of `_last`
        self._total = np.zeros(1)  # discounted rewards as of `_last`
        self._last = np.zeros(1, np.int64)  # parent's clock when the two were written
        self._clock = np.zeros(1, np.int64)  # samples through this node
        self._children = np.zeros(1, np.int64)

    def __len__(self) -> int:
        return len(self.plans)

    def children(self, node: int) -> int:
        """Return how many children a node has."""
        return int(self._children[node])

    def descend(self) -> int:
        """Return the node to expand: follow the policy while nodes have children enough."""
        node = ROOT
        while self._children[node] > 0 and self._children[node] ** 2 > self._clock[node]:
            node = self._select(node)
        return node

    def _select(self, node: int) -> int:
        if self._boltzmann is not None:
            children = self._children_of(node)
            values = self._total[children] / np.maximum(self._weight[children], 1e-12)
            return children[self._boltzmann.draw(values, int(self._clock[node]))]
        return int(
            select_child(
                node,
                self._first_child,
                self._sibling,
                self._weight,
                self._total,
                self._last,
                self._clock,
                self.gamma,
                self.exploration,
            )
        )

    def _children_of(self, node: int) -> list[int]:
        found, child = [], int(self._first_child[node])
        while child != NONE:
            found.append(child)
            child = int(self._sibling[child])
        return found

    def expand(self, parent: int, plan: NDArray[np.int32]) -> int:
        """Add a child with this plan; returns the node."""
        node = len(self.plans)
        self.plans.append(plan)
        if node >= len(self._parent):
            self._grow()
        self._parent[node] = parent
        self._first_child[node] = NONE
        self._sibling[node] = self._first_child[parent]
        self._first_child[parent] = node
        self._children[parent] += 1
        return node

    def _grow(self) -> None:
        for name in (
            "_parent",
            "_first_child",
            "_sibling",
            "_weight",
            "_total",
            "_last",
            "_clock",
            "_children",
        ):
            array = getattr(self, name)
            setattr(self, name, np.concatenate([array, np.zeros_like(array)]))

    def backup(self, node: int, reward: float) -> None:
        """Add a reward in [0, 1] to a node and all above it, discounting what was there."""
        self._clock[node] += 1
        while node != ROOT:
            parent = int(self._parent[node])
            self._clock[parent] += 1
            age = int(self._clock[parent] - self._last[node])
            fade = self.gamma**age
            self._weight[node] = self._weight[node] * fade + 1.0
            self._total[node] = self._total[node] * fade + reward
            self._last[node] = self._clock[parent]
            node = parent

    def best_plans(self, count: int) -> tuple[NDArray[np.int32], ...]:
        """Return up to `count` different plans, highest discounted value first."""
        value = self._total[: len(self)] / np.maximum(self._weight[: len(self)], 1e-12)
        value[ROOT] = -1.0 if len(self) > 1 else 0.0
        chosen: dict[bytes, NDArray[np.int32]] = {}
        for node in np.argsort(-value, kind="stable"):
            chosen.setdefault(self.plans[node].tobytes(), self.plans[node])
            if len(chosen) == count:
                break
        return tuple(chosen.values())
