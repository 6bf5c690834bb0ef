"""The dependency graph as arrays, with the kind of every edge.

It says which contour must be printed before which. Contours are numbered in
source order and the source order is a linear extension, so every edge (a, b)
has a < b. Built in `decmcts.feasibility.build`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Int32s, Ints
from decmcts.print.brief import brief


class EdgeKind(IntEnum):
    """Why one contour must come before another."""

    GEOMETRY = 1  # printing b first would block the head at a
    PROCESS = 2  # touching contours of different roles keep the slicer's order
    STATE = 3  # first layer, temperature, unknown command: nothing moves across
    QUALITY = 4  # shells as sliced, and what is anchored in them after them
    LEAD = 5  # no island runs too many layers ahead of the others
    PRIMING = 6  # what primes the nozzle comes first; a brim before what touches it
    CONTACT = 7  # printing b, the nozzle goes into a's bead; the source means it so


@dataclass(frozen=True, slots=True)
class DependencyGraph:
    """Edges (a, b), a before b, in CSR form from both sides.

    A sparse subset with the same transitive closure as the full definition.
    """

    pred_offsets: Ints  # (n + 1,)
    preds: Int32s  # (m,) predecessors of b at pred_offsets[b]:pred_offsets[b + 1]
    kinds: NDArray[np.uint8]  # (m,) EdgeKind, aligned with preds
    succ_offsets: Ints  # (n + 1,)
    succs: Int32s  # (m,)

    __repr__ = brief("n", "n_edges")

    @property
    def n(self) -> int:
        """Number of contours."""
        return len(self.pred_offsets) - 1

    @property
    def n_edges(self) -> int:
        """Number of stored edges."""
        return len(self.preds)

    def pairs(self) -> Int32s:
        """Return the edges as (m, 2) rows (a, b)."""
        b = np.repeat(np.arange(self.n, dtype=np.int32), np.diff(self.pred_offsets))
        return np.stack([self.preds, b], axis=1)

    def with_edges(
        self, pairs: NDArray[np.integer], kind: EdgeKind, *, over: bool = False
    ) -> DependencyGraph:
        """Return the graph with more edges (k, 2) of a kind.

        Those that are there keep their own kind, unless this one counts `over` it.
        """
        if not len(pairs):
            return self
        there, more = (rows.astype(np.int64) @ [self.n, 1] for rows in (self.pairs(), pairs))
        kept = ~(np.isin(there, more) & over)
        fresh = np.setdiff1d(more, there[kept])
        both = np.concatenate([there[kept], fresh])
        kinds = np.concatenate([self.kinds[kept], np.full(len(fresh), kind, np.uint8)])
        return DependencyGraph.from_pairs(
            self.n, np.stack([both // self.n, both % self.n], axis=1), kinds
        )

    @staticmethod
    def from_pairs(
        n: int, pairs: NDArray[np.integer], kinds: NDArray[np.uint8] | None = None
    ) -> DependencyGraph:
        """Build from (m, 2) rows (a, b); raises ValueError unless 0 <= a < b < n."""
        pairs = np.asarray(pairs, np.int32).reshape(-1, 2)
        if len(pairs) and not (pairs[:, 0].min() >= 0 and pairs[:, 1].max() < n):
            raise ValueError(f"edge outside 0..{n - 1}")
        if len(pairs) and not (pairs[:, 0] < pairs[:, 1]).all():
            raise ValueError("an edge (a, b) needs a < b: the source order is a linear extension")
        kind = np.full(len(pairs), EdgeKind.GEOMETRY, np.uint8) if kinds is None else kinds
        by_b = np.lexsort((pairs[:, 0], pairs[:, 1]))
        by_a = np.lexsort((pairs[:, 1], pairs[:, 0]))
        return DependencyGraph(
            _offsets(pairs[:, 1], n),
            np.ascontiguousarray(pairs[by_b, 0]),
            np.ascontiguousarray(kind[by_b]),
            _offsets(pairs[:, 0], n),
            np.ascontiguousarray(pairs[by_a, 1]),
        )


def _offsets(ids: Int32s, n: int) -> Ints:
    return np.concatenate([[0], np.cumsum(np.bincount(ids, minlength=n))]).astype(np.int64)
