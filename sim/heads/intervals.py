"""Whether a head's signals are as far apart in time as its controller can tell them apart.

Klipper drops changes of an output nearer than 0.1 s, so of two such signals none may come. Times
are the least that the lines of a file can take: their moves at the feeds they name, without
acceleration, and what they dwell. A wait takes as long as it takes, at least none.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from sim.arrays import Floats
from sim.faults import Fault, FaultKind, listed
from sim.heads.file import HeadFile

ROUNDING_S = 1e-4
SPARE, SPARE_S = 0.1, 0.01  # by which a writer may put signals further apart


def least_clock(file: HeadFile) -> Floats:
    """Return the least seconds from the begin of a file to each of its lines, (lines + 2,)."""
    motion = file.motion
    clock = np.zeros(len(file.lines) + 2)  # clock[k]: all lines above k, from 1, have been run
    length = np.linalg.norm(np.diff(motion.points, axis=0), axis=1)
    moving = (length > 0.0) & (motion.feed > 0.0)
    seconds = length[moving] / motion.feed[moving]
    np.add.at(clock, motion.line[moving] + 2, seconds)
    clock[np.array(file.rests.dwells, np.int64) + 1] += np.diff(file.rests.total_ms) / 1000.0
    return np.asarray(np.cumsum(clock))


class Intervals:
    """The least times of all files, and what an interval excuses."""

    def __init__(self, files: Sequence[HeadFile], interval_s: float) -> None:
        self._files, self._interval_s = files, interval_s
        self._near_s = interval_s * (1.0 + SPARE) + SPARE_S if interval_s > 0.0 else 0.0
        self._clocks = [least_clock(file) for file in files] if interval_s > 0.0 else []

    def check(self) -> list[Fault]:
        """Check that each head leaves so many seconds between two of its signals."""
        lines = [
            f"{Path(file.path).name} line {later} signals {clock[later] - clock[line]:.3f} s after "
            f"line {line}, the machine's controllers tell {self._interval_s:g} s apart"
            for file, clock in zip(self._files, self._clocks, strict=False)
            for line, later in pairwise(file.rests.signals)
            if clock[later] - clock[line] < self._interval_s - ROUNDING_S
        ]
        return listed(FaultKind.COMMAND, lines)

    def excuse(self, head: int, reached: int, line: int) -> bool:
        """Tell whether what a head reached in a line may be signalled in a later one for this.

        That is where another signal would be too near: the later one itself, or the one before.
        """
        if self._near_s <= 0.0 or line <= reached:
            return False
        clock, given = self._clocks[head], self._files[head].rests.signals
        k = bisect_left(given, line)
        passed = clock[reached + 1]
        behind = k > 0 and passed - clock[given[k - 1]] < self._near_s
        return bool(clock[line] - passed < self._near_s or behind)
