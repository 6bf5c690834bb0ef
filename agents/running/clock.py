"""The clock of a print: seconds since it began, the same in all processes of one host.

A simulated print may go faster than the world, and as fast as it while heads are planned for.
The launcher writes when that changes to a small file in memory, which everybody maps. Real
controllers print at a pace of 1.
"""

from __future__ import annotations

import math
import mmap
import struct
import time
from pathlib import Path

_SIZE = 5 * 8  # changes so far, twice; then, there, pace: see `_read`


class PrintClock:
    """Maps a clock that `made` made; whoever has it may read it, and one process sets its pace."""

    def __init__(self, path: Path) -> None:
        with path.open("r+b") as file:
            self._map = mmap.mmap(file.fileno(), _SIZE)

    @classmethod
    def made(cls, path: Path, pace: float) -> PrintClock:
        """Make a clock that stands at 0 and goes from now on."""
        path.write_bytes(bytes(_SIZE))
        clock = cls(path)
        clock._write(1.0, time.monotonic(), 0.0, pace)
        return clock

    @property
    def pace(self) -> float:
        """Seconds of the print in one of the world."""
        return self._read()[2]

    def now(self) -> float:
        """Return seconds since the print began; never less than anybody was told before."""
        while True:
            then, there, pace = self._read()
            now = time.monotonic()
            if self._read()[0] == then:  # else the pace has changed since
                return there + (now - then) * pace

    def until(self, time_s: float) -> float:
        """Return seconds of the world until so late in the print; 0 for what has passed."""
        return max(0.0, (time_s - self.now()) / self.pace) if math.isfinite(time_s) else math.inf

    def set_pace(self, pace: float) -> None:
        """Go faster or slower from now on."""
        then, there, before = self._read()
        (changes,) = struct.unpack_from("=d", self._map, 0)
        struct.pack_into("=d", self._map, 0, -changes)  # readers wait: nobody is told a later time
        now = time.monotonic()
        self._write(changes + 1.0, now, there + (now - then) * before, pace)

    def _write(self, changes: float, then: float, there: float, pace: float) -> None:
        struct.pack_into("=dddd", self._map, 8, changes, then, there, pace)
        struct.pack_into("=d", self._map, 0, changes)

    def _read(self) -> tuple[float, float, float]:
        """Return when the pace changed last, where the print was then, and the pace."""
        while True:
            first, second, then, there, pace = struct.unpack_from("=ddddd", self._map, 0)
            if first == second and first == struct.unpack_from("=d", self._map, 0)[0]:
                return then, there, pace
