"""Branch and bound over assignments: exact where the assignment is nearly a sequence.

An assignment of successors may be several cycles, or break precedence along a run
of steps. Not all steps of such a cycle or run can be kept: each branch
forbids one of them and keeps those before it. Best bound first. Strong where
precedence is sparse and costs are unlike distances; hopeless elsewhere.

References
----------
Carpaneto & Toth 1980, "Some new branching and bounding criteria for the
asymmetric travelling salesman problem".
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from decmcts.search.sop.assignment import patch_cycles
from decmcts.search.sop.precedence import Precedence

NodePair = tuple[int, int]
_MOST_OPEN = 200_000  # branches kept; beyond, the tree gives up


@dataclass(order=True, slots=True)
class Branch:
    """Sequences with certain steps and without others."""

    bound: float
    depth: int  # negative: of equal bounds the deepest first
    number: int
    following: NDArray[np.int64] = field(compare=False)  # (n,) their cheapest assignment
    kept: tuple[NodePair, ...] = field(compare=False)
    forbidden: tuple[NodePair, ...] = field(compare=False)


@dataclass(slots=True)
class AssignmentTree:
    """The search tree; mutable. Node 0 is first, node n − 1 last."""

    table: NDArray[np.float64]  # (n, n) reduced costs; impossible steps are infinite
    precedence: Precedence
    open: list[Branch] = field(default_factory=list)
    made: int = 0
    exhausted: bool = False  # nothing below the limit is left

    def __post_init__(self) -> None:
        self._add((), (), np.inf)

    @property
    def bound(self) -> float:
        """No sequence costs less, or else less than the limit of the last `step`."""
        return self.open[0].bound if self.open else np.inf

    def step(self, below: float) -> NDArray[np.int64] | None:
        """Branch once, on what may cost less than `below`; return a relaxed sequence, if any.

        It starts with node 0 and ends with n − 1 but may break precedence.
        """
        if not self.open or self.open[0].bound >= below or len(self.open) > _MOST_OPEN:
            self.exhausted = not self.open or self.open[0].bound >= below
            return None
        branch = heapq.heappop(self.open)
        order = patch_cycles(self.table, branch.following)
        steps = self._clash(branch)
        free = [step for step in steps if step not in branch.kept]
        for k, step in enumerate(free):
            self._add(branch.kept + tuple(free[:k]), (*branch.forbidden, step), below)
        return order

    def _add(
        self, kept: tuple[NodePair, ...], forbidden: tuple[NodePair, ...], below: float
    ) -> None:
        """Add a branch unless its bound is too high or it has no assignment."""
        table = self.table[:-1, 1:].copy()
        for a, b in kept:
            cost = table[a, b - 1]
            table[a] = np.inf
            table[:, b - 1] = np.inf
            table[a, b - 1] = cost
        for a, b in forbidden:
            table[a, b - 1] = np.inf
        try:
            rows, columns = linear_sum_assignment(table)
        except ValueError:  # scipy: there is no assignment
            return
        bound = float(table[rows, columns].sum())
        if bound < below:
            following = np.append(columns + 1, 0)
            self.made += 1
            branch = Branch(bound, -len(forbidden), self.made, following, kept, forbidden)
            heapq.heappush(self.open, branch)

    def _clash(self, branch: Branch) -> list[NodePair]:
        """Return steps of the assignment that no sequence has together, as few free as possible."""
        after, n = branch.following, len(branch.following)
        links = csr_array((np.ones(n), (np.arange(n), after)), shape=(n, n))
        cycles, label = connected_components(links, directed=True, connection="strong")
        fixed = {a for a, _ in branch.kept}
        clashes = []
        for cycle in range(cycles):
            nodes = np.flatnonzero(label == cycle).tolist()
            if n - 1 not in nodes:
                clashes.append(nodes)
        clashes.append(self._broken(after))
        clashes = [nodes for nodes in clashes if nodes]
        if not clashes:
            return []
        nodes = min(clashes, key=lambda nodes: sum(a not in fixed for a in nodes))
        return [(a, int(after[a])) for a in nodes]

    def _broken(self, after: NDArray[np.int64]) -> list[int]:
        """Return what a shortest run of the first node's path that breaks order leaves."""
        path = [0]
        while path[-1] != len(after) - 1:
            path.append(int(after[path[-1]]))
        late = self.precedence.before[np.ix_(path, path)].T  # [i, k]: path[k] must precede path[i]
        first, second = np.nonzero(np.triu(late, 1))
        if not len(first):
            return []
        k = int(np.argmin(second - first))
        return path[first[k] : second[k]]
