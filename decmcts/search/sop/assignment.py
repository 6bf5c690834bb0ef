"""What the assignment problem gives for a sequence: a bound, reduced costs, a start.

Each node but the first is entered once and each but the last left once. The
cheapest way to do that may be several cycles in place of one sequence, so its cost is a
lower bound. Its dual variables are prices of nodes. A step's reduced cost is what it costs
beyond the prices of its two nodes. It is never negative, and comparable between nodes.

References
----------
Karp 1979, "A patching algorithm for the nonsymmetric traveling-salesman problem".

**Branch and bound** over assignments is exact where the assignment is nearly a sequence. An
assignment of successors may be several cycles, or break precedence along a run of steps. Not all
steps of such a cycle or run can be kept: each branch forbids one of them and keeps those before it.
Best bound first. Strong where precedence is sparse and costs are unlike distances; hopeless
elsewhere.

References
----------
Carpaneto & Toth 1980, "Some new branching and bounding criteria for the
asymmetric travelling salesman problem".
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from decmcts.arrays import Flags, Floats, Ints
from decmcts.search.sop.precedence import Precedence


@dataclass(frozen=True, slots=True)
class Assignment:
    """The cheapest assignment of successors. Node 0 is first, node n − 1 last."""

    bound: float  # its cost: no sequence is cheaper
    reduced: Floats  # (n, n) >= 0; a sequence costs `bound` more in real costs
    following: Ints  # (n,) successor of each node; of the last one, the first


def assign(costs: Floats, possible: Flags) -> Assignment:
    """Solve the assignment problem over the possible steps. O(n³)."""
    n = len(costs)
    dear = 1.0 + 2.0 * n * float(costs.max(initial=0.0))
    table = np.where(possible, costs, dear)[: n - 1, 1:]
    _, column = linear_sum_assignment(table)
    prices = _prices(table, column)
    leaving = table[np.arange(n - 1), column] - prices[column]
    reduced = np.zeros((n, n))
    reduced[: n - 1, 1:] = table - leaving[:, None] - prices[None, :]
    reduced[~possible] = 0.0
    following = np.concatenate([column + 1, [0]]).astype(np.int64)
    bound = float(leaving.sum() + prices.sum())
    return Assignment(bound, np.maximum(reduced, 0.0), following)


def _prices(table: Floats, column: Ints) -> Floats:
    """Return the dual variables of the columns: shortest paths in the residual graph."""
    taken = table[np.arange(len(table)), column]
    prices = np.zeros(len(table))
    for _ in range(len(table)):
        shorter = np.minimum(prices, ((prices[column] - taken)[:, None] + table).min(axis=0))
        if not (shorter < prices).any():
            break
        prices = shorter
    return prices


def patch_cycles(table: Floats, following: Ints) -> Ints:
    """Return a sequence: an assignment's cycles patched to one, the two largest at a time.

    It starts with node 0 and ends with n − 1 but may break precedence. `table` (n, n) holds
    costs, infinite for impossible steps.
    """
    n = len(table)
    dear = 1.0 + 2.0 * n * float(table.max(initial=0.0, where=np.isfinite(table)))
    prices = np.where(np.isfinite(table), table, dear)
    prices[:, 0] = prices[n - 1] = dear * n
    prices[n - 1, 0] = 0.0
    after = following.copy()
    while True:
        links = csr_array((np.ones(n), (np.arange(n), after)), shape=(n, n))
        cycles, label = connected_components(links, directed=True, connection="strong")
        if cycles == 1:
            break
        first, second = np.argsort(-np.bincount(label), kind="stable")[:2]
        a, b = np.flatnonzero(label == first), np.flatnonzero(label == second)
        joined = prices[np.ix_(a, after[b])] + prices[np.ix_(b, after[a])].T
        joined -= prices[a, after[a]][:, None] + prices[b, after[b]][None, :]
        i, j = np.unravel_index(int(np.argmin(joined)), joined.shape)
        after[a[i]], after[b[j]] = after[b[j]], after[a[i]]
    order = np.zeros(n, np.int64)
    for k in range(1, n):
        order[k] = after[order[k - 1]]
    return order


NodePair = tuple[int, int]
_MOST_OPEN = 200_000  # branches kept; beyond, the tree gives up


@dataclass(order=True, slots=True)
class Branch:
    """Sequences with certain steps and without others."""

    bound: float
    depth: int  # negative: of equal bounds the deepest first
    number: int
    following: Ints = field(compare=False)  # (n,) their cheapest assignment
    kept: tuple[NodePair, ...] = field(compare=False)
    forbidden: tuple[NodePair, ...] = field(compare=False)


@dataclass(slots=True)
class AssignmentTree:
    """The search tree; mutable. Node 0 is first, node n − 1 last."""

    table: Floats  # (n, n) reduced costs; impossible steps are infinite
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

    def step(self, below: float) -> Ints | None:
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

    def _broken(self, after: Ints) -> list[int]:
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
