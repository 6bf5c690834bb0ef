"""What the sync points of several files order, for every timing.

A file is a chain of lines. Behind a wait its head knows how far the head that signalled was, and
all that one knew then. So a vector clock suffices: for each line, one line number for each head.

References
----------
Mattern 1988, "Virtual time and global states of distributed systems".
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence

from sim.heads.file import Sync


class Knowledge:
    """How far each head knows the others to be, line by line."""

    def __init__(self, syncs: Sequence[Sequence[Sync]]) -> None:
        n = len(syncs)
        self._lines: list[list[int]] = [[0] for _ in syncs]
        self._vectors: list[list[list[int]]] = [[[0] * n] for _ in syncs]
        self.faults = _unpaired(syncs)
        given: dict[int, tuple[int, int, list[int]]] = {}
        todo = [0] * n
        moved = True
        while moved:
            moved = False
            for h, points in enumerate(syncs):
                while todo[h] < len(points) and self._pass(h, points[todo[h]], given):
                    todo[h] += 1
                    moved = True
        self.stuck = [
            (h, points[todo[h]].line) for h, points in enumerate(syncs) if todo[h] < len(points)
        ]

    def _pass(self, head: int, sync: Sync, given: dict[int, tuple[int, int, list[int]]]) -> bool:
        """Go past one sync point in place; False: its number was not signalled yet."""
        now = self._vectors[head][-1]
        if sync.signal:
            given.setdefault(sync.number, (head, sync.line, now))
            return True
        if sync.number not in given:
            return False
        other, line, then = given[sync.number]
        merged = [max(a, b) for a, b in zip(now, then, strict=True)]
        merged[other] = max(merged[other], line)
        self._lines[head].append(sync.line)
        self._vectors[head].append(merged)
        return True

    def done(self, head: int, line: int, other: int) -> int:
        """Return the line of `other` above which all is done when `head` comes to `line`."""
        return self._vectors[head][bisect_left(self._lines[head], line) - 1][other]


def _unpaired(syncs: Sequence[Sequence[Sync]]) -> list[str]:
    """Return a line for each number signalled twice, never signalled or never waited for."""
    signals = Counter(s.number for points in syncs for s in points if s.signal)
    waits = {s.number for points in syncs for s in points if not s.signal}
    lines = [f"number {n} is given {signals[n]} times" for n in sorted(signals) if signals[n] > 1]
    lines += [f"number {n} is waited for and never given" for n in sorted(waits - signals.keys())]
    lines += [f"number {n} is given and nobody waits" for n in sorted(signals.keys() - waits)]
    return lines
