"""A head's D-UCT tree over its own plans.

D-UCT goes down the tree by the largest upper confidence bound, in which old
rewards count less (discounted), since the other heads' plans change meanwhile.

A node is a whole plan. A child is its parent's plan after one exchange: another
policy, or some macro-actions sooner or later (Fu, Qiu & Zha 2021 search complete
tours the same way). A node that has been seen often gets more children
(progressive widening). Nothing here is compiled: one sample costs a whole rollout.

References
----------
Best et al. 2019, Sec. 4.3 (D-UCT).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from decmcts.arrays import Int32s

LEAST = 1e-12  # of discounted visits, by which is divided


@dataclass(slots=True, eq=False)
class Node:
    """A plan, and what is known of it and those below it."""

    plan: Int32s
    parent: Node | None = None
    children: list[Node] = field(default_factory=list)
    clock: int = 0  # samples through this node
    last: int = 0  # the parent's clock when the next two were written
    weight: float = 0.0  # discounted visits as of `last`
    total: float = 0.0  # discounted rewards as of `last`

    @property
    def value(self) -> float:
        """Mean discounted reward."""
        return self.total / max(self.weight, LEAST)


class Tree:
    """The tree; grows in place."""

    def __init__(self, root: Int32s, *, gamma: float, exploration: float) -> None:
        self.gamma, self.exploration = gamma, exploration
        self.root = Node(root)
        self._nodes: list[Node] = []  # but the root, oldest first

    def descend(self) -> Node:
        """Return the node to expand: follow D-UCT while nodes have children enough."""
        node = self.root
        while node.children and len(node.children) ** 2 > node.clock:
            node = self.select(node)
        return node

    def select(self, node: Node) -> Node:
        """Return the child with the largest bound U = F + 2·C·sqrt(ln t_parent / t_child).

        Of equals the newest.
        """
        newest = node.children[::-1]
        own = [child.weight * self.gamma ** (node.clock - child.last) for child in newest]
        log = math.log(max(sum(own), 1.0))
        bounds = [
            child.total / child.weight + 2.0 * self.exploration * math.sqrt(log / max(t, LEAST))
            for child, t in zip(newest, own, strict=True)
        ]
        return newest[bounds.index(max(bounds))]

    def expand(self, parent: Node, plan: Int32s) -> Node:
        """Add a child with this plan and return it."""
        node = Node(plan, parent)
        parent.children.append(node)
        self._nodes.append(node)
        return node

    def backup(self, node: Node, reward: float) -> None:
        """Add a reward in [0, 1] to a node and all above it, discounting what was there."""
        node.clock += 1
        while node.parent is not None:
            parent = node.parent
            parent.clock += 1
            fade = self.gamma ** (parent.clock - node.last)
            node.weight = node.weight * fade + 1.0
            node.total = node.total * fade + reward
            node.last = parent.clock
            node = parent

    def best_plans(self, count: int) -> tuple[Int32s, ...]:
        """Return up to `count` different plans, highest discounted value first, the root last."""
        best = sorted(self._nodes, key=lambda node: node.value, reverse=True)
        chosen: dict[bytes, Int32s] = {}
        for node in [*best, self.root]:
            if len(chosen) < count:
                chosen.setdefault(node.plan.tobytes(), node.plan)
        return tuple(chosen.values())
