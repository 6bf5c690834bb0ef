"""The least time between what heads did and the begin of a leg, whatever the timing.

A head may be slower than planned and may rest wherever it likes, but no leg takes less
than its motion. So the least time from the end of one leg to the begin of another is the
longest way between them through the partial order: along legs, waits and lags.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator

import numpy as np

from sim.arrays import Floats
from sim.content.legs import Legs
from sim.rules.order import PartialOrder


class LeastTime:
    """The partial order with what each leg takes at least."""

    def __init__(self, legs: Legs, order: PartialOrder, seconds: list[Floats]) -> None:
        """Take the legs' seconds, (n_legs,) a head."""
        self._order, self._seconds = order, seconds
        self._rank = [np.empty(len(actions), np.int64) for actions in legs.all_actions]
        for rank, (head, leg) in enumerate(order.sequence.tolist()):
            self._rank[head][leg] = rank
        self._waits = [
            {
                k: actions.after_edges(k)
                for k in np.flatnonzero(np.diff(actions.after_offsets)).tolist()
            }
            for actions in legs.all_actions
        ]

    def since(self, head: int, leg: int, limit_s: float) -> Iterator[tuple[int, int, float]]:
        """Yield (head, leg, seconds) of each leg that may have ended less than `limit_s` before.

        Only legs that have ended for sure when the given one begins. Backwards through the
        order: a leg is looked at when all that follows it has been.
        """
        done = np.zeros(len(self._seconds), np.int64)  # legs of each head that ended long before
        least: dict[tuple[int, int], float] = {}
        heap: list[tuple[int, int, int]] = []
        self._step(head, leg, 0.0, least, heap)
        while heap:
            _, g, k = heapq.heappop(heap)
            passed = least[g, k]
            if k < done[g]:
                continue
            if passed >= limit_s:
                np.maximum(done, self._order.clocks[g][k], out=done)
                continue
            yield g, k, passed
            self._step(g, k, passed + float(self._seconds[g][k]), least, heap)

    def _step(
        self,
        head: int,
        leg: int,
        begun: float,
        least: dict[tuple[int, int], float],
        heap: list[tuple[int, int, int]],
    ) -> None:
        """Note what has ended when a leg begins, `begun` seconds before; mutates both."""
        ended = [(edge.head, edge.action, edge.lag_s) for edge in self._waits[head].get(leg, ())]
        if leg:
            ended.append((head, leg - 1, 0.0))
        for g, k, lag_s in ended:
            if (g, k) not in least:
                heapq.heappush(heap, (-int(self._rank[g][k]), g, k))
            least[g, k] = max(least.get((g, k), 0.0), begun + lag_s)
