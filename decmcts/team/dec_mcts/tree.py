"""A head's D-UCT tree over its own plans, as a struct of arrays.

D-UCT goes down the tree by the largest upper confidence bound, in which old
rewards count less (discounted), since the other heads' plans change meanwhile.

A node is a whole plan. A child is its parent's plan after one exchange: another
policy, or some macro-actions sooner or later (Fu, Qiu & Zha 2021 search complete
tours the same way). A node that has been seen often gets more children
(progressive widening). Only the arithmetic of selection is
compiled (`decmcts.team.dec_mcts.tree_kernels`): one sample costs a whole rollout.

References
----------
Best et al. 2019, Sec. 4.3 (D-UCT).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.team.dec_mcts.tree_kernels import select_child

ROOT = 0
NONE = -1


class Tree:
    """The tree; grows in place."""

    def __init__(self, root: NDArray[np.int32], *, gamma: float, exploration: float) -> None:
        self.gamma, self.exploration = gamma, exploration
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
        """Return the node to expand: follow D-UCT while nodes have children enough."""
        node = ROOT
        while self._children[node] > 0 and self._children[node] ** 2 > self._clock[node]:
            node = self._select(node)
        return node

    def _select(self, node: int) -> int:
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
