"""An order that keeps to a tool as long as it may: few changes of tools.

With the tool in use all is printed that precedence allows, then the tool is taken with which most
can be printed. Of two tools no order that begins with the same one has fewer changes: whatever it
has printed by its k-th change, this one has printed too, by induction over k.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from decmcts.feasibility.graph import DependencyGraph

Ints = NDArray[np.int32]
May = Callable[[int, int], bool]
"""Tells whether a tool may be changed for another."""
NONE = -1


@dataclass(frozen=True, slots=True)
class ToolRuns:
    """An order, and where its tools change."""

    order: Ints  # (n,)
    run: Ints  # (n,) by place in the order, never falling: one tool, within one stretch


def by_tool(
    graph: DependencyGraph, tool: NDArray[np.int16], stretch: Ints, may: May
) -> ToolRuns | None:
    """Return an order with few changes of tools; None where no allowed change leads on.

    Each stretch begins and ends with the tool that it begins and ends with in the source. Within
    a run contours stand as in the source, as far as precedence allows. Takes
    O((n + edges) k log n) for k tools in use, for each change.

    Parameters
    ----------
    tool, stretch : (n,)
        In the source's order, which keeps `graph`; `stretch` never falls.
    may
        Whether one tool may be changed for another.
    """
    front = _Front.of(graph, tool)
    order, run, number = list[int](), list[int](), 0
    edges = [*np.flatnonzero(np.diff(stretch, prepend=-1)).tolist(), len(stretch)]
    for begin, end in pairwise(edges):
        front.enter(begin, end)
        now, last = int(tool[begin]), end - 1
        while len(order) < end:
            held = last if len(order) < last else NONE  # so the last is of the source's last tool
            mine = front.within_reach(now, held)
            if not mine:
                following = front.following(now, may, held)
                if following is None:
                    return None
                now, number = following, number + 1
                continue
            front.print(mine)
            order += mine
            run += [number] * len(mine)
        number += 1
    return ToolRuns(np.array(order, np.int32), np.array(run, np.int32))


@dataclass(slots=True)
class _Front:
    """What can be printed next, by tool."""

    succ_offsets: list[int]
    succs: list[int]
    tool: list[int]
    waits: list[int]  # of each contour how many it depends on are not printed
    ready: dict[int, set[int]]
    end: int = 0  # of the stretch

    @staticmethod
    def of(graph: DependencyGraph, tool: NDArray[np.int16]) -> _Front:
        """Return the front before anything is printed."""
        return _Front(
            graph.succ_offsets.tolist(), graph.succs.tolist(), tool.tolist(),
            np.diff(graph.pred_offsets).tolist(), {int(t): set() for t in np.unique(tool)},
        )  # fmt: skip

    def enter(self, begin: int, end: int) -> None:
        """Begin a stretch; mutates the front."""
        self.end = end
        for c in range(begin, end):
            if not self.waits[c]:
                self.ready[self.tool[c]].add(c)

    def within_reach(self, tool: int, held: int) -> list[int]:
        """Return all that can be printed with one tool alone, but for a contour that is held."""
        heap, less, found = sorted(self.ready[tool]), dict[int, int](), list[int]()
        while heap:
            c = heapq.heappop(heap)
            if c == held:
                continue
            found.append(c)
            for b in self._above(c):
                less[b] = less.get(b, 0) + 1
                if less[b] == self.waits[b] and self.tool[b] == tool and b < self.end:
                    heapq.heappush(heap, b)
        return found

    def following(self, now: int, may: May, held: int) -> int | None:
        """Return the tool with which most can be printed next; None: there is none."""
        reach = {t: len(self.within_reach(t, held)) for t in self.ready if t != now and may(now, t)}
        best = max(reach, key=lambda t: (reach[t], -t), default=None)
        return best if best is not None and reach[best] else None

    def print(self, contours: list[int]) -> None:
        """Take contours as printed; mutates the front."""
        for c in contours:
            for b in self._above(c):
                self.waits[b] -= 1
                if not self.waits[b] and b < self.end:
                    self.ready[self.tool[b]].add(b)
        for c in contours:
            self.ready[self.tool[c]].discard(c)

    def _above(self, c: int) -> list[int]:
        return self.succs[self.succ_offsets[c] : self.succ_offsets[c + 1]]
