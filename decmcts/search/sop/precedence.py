"""Bare precedence: a numbering in which every edge goes forward, closure and reduction.

For problems that come without a source order. Dense matrices: meant for a few
thousand nodes.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Flags, Int32s, Ints
from decmcts.errors import InputError


@dataclass(frozen=True, slots=True)
class Precedence:
    """Which node must come before which, in a numbering that is a linear extension."""

    original: Int32s  # (n,) the caller's number of each node
    before: Flags  # (n, n) closure: row somewhere before column; strictly upper
    direct: Flags  # (n, n) transitive reduction of `before`

    @property
    def possible(self) -> Flags:
        """Which column may directly follow which row, (n, n)."""
        steps = ~self.before.T & (self.direct | ~self.before)
        np.fill_diagonal(steps, False)
        return steps

    @property
    def pairs(self) -> Int32s:
        """The reduction's edges, (m, 2) rows (a, b)."""
        return np.argwhere(self.direct).astype(np.int32)

    def reversed(self) -> Precedence:
        """Return the precedence of the sequences reversed."""
        return Precedence(
            self.original[::-1],
            np.ascontiguousarray(self.before.T[::-1, ::-1]),
            np.ascontiguousarray(self.direct.T[::-1, ::-1]),
        )

    def repaired(self, order: Ints) -> Int32s:
        """Return a linear extension near `order`: always the first in it of those that may come."""
        return order[_linear_extension(self.direct[np.ix_(order, order)])].astype(np.int32)

    @staticmethod
    def of(n: int, pairs: Int32s) -> Precedence:
        """Return (m, 2) rows (a, b), a before b, renumbered, closed and reduced. O(n · m).

        Raises
        ------
        InputError
            If nodes must come before each other; they are named, from 1.
        """
        edges = np.zeros((n, n), np.bool_)
        edges[pairs[:, 0], pairs[:, 1]] = True
        original = _linear_extension(edges)
        edges = edges[np.ix_(original, original)]
        before, direct = np.zeros((n, n), np.bool_), np.zeros((n, n), np.bool_)
        for a in range(n - 1, -1, -1):
            beyond = before[np.flatnonzero(edges[a])].any(axis=0)
            direct[a] = edges[a] & ~beyond
            before[a] = edges[a] | beyond
        return Precedence(original, before, direct)


def _linear_extension(edges: Flags) -> Int32s:
    """Return the nodes in an order that breaks no edge, lowest numbers first."""
    missing = edges.sum(axis=0)
    ready = [int(node) for node in np.flatnonzero(missing == 0)]
    order: list[int] = []
    while ready:
        node = heapq.heappop(ready)
        order.append(node)
        following = np.flatnonzero(edges[node])
        missing[following] -= 1
        for freed in following[missing[following] == 0]:
            heapq.heappush(ready, int(freed))
    if len(order) < len(edges):
        raise InputError(
            f"the precedence has a cycle: {' → '.join(_cycle(edges, missing > 0))}",
            advice="drop one of its constraints",
        )
    return np.array(order, np.int32)


def _cycle(edges: Flags, left: Flags) -> list[str]:
    """Return the nodes of one cycle, numbered from 1; every node left has one before it."""
    walk, node = [], int(np.flatnonzero(left)[0])
    while node not in walk:
        walk.append(node)
        node = int(np.flatnonzero(edges[:, node] & left)[0])
    cycle = [node, *reversed(walk[walk.index(node) :])]
    return [str(a + 1) for a in cycle]
