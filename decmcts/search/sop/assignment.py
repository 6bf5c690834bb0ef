"""What the assignment problem gives for a sequence: a bound, reduced costs, a start.

Each node but the first is entered once and each but the last left once. The
cheapest way to do that may be several cycles in place of one sequence, so its cost is a
lower bound. Its dual variables are prices of nodes. A step's reduced cost is what it costs
beyond the prices of its two nodes. It is never negative, and comparable between nodes.

References
----------
Karp 1979, "A patching algorithm for the nonsymmetric traveling-salesman problem".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components


@dataclass(frozen=True, slots=True)
class Assignment:
    """The cheapest assignment of successors. Node 0 is first, node n − 1 last."""

    bound: float  # its cost: no sequence is cheaper
    reduced: NDArray[np.float64]  # (n, n) >= 0; a sequence costs `bound` more in real costs
    following: NDArray[np.int64]  # (n,) successor of each node; of the last one, the first


def assign(costs: NDArray[np.float64], possible: NDArray[np.bool_]) -> Assignment:
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


def _prices(table: NDArray[np.float64], column: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the dual variables of the columns: shortest paths in the residual graph."""
    taken = table[np.arange(len(table)), column]
    prices = np.zeros(len(table))
    for _ in range(len(table)):
        shorter = np.minimum(prices, ((prices[column] - taken)[:, None] + table).min(axis=0))
        if not (shorter < prices).any():
            break
        prices = shorter
    return prices


def patch_cycles(table: NDArray[np.float64], following: NDArray[np.int64]) -> NDArray[np.int64]:
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
