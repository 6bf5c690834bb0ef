"""Sync points of several files: read by the words of a machine, and what they order.

A number stands in the line, or else it is made of the head that gives it and of how many it has
given: then a wait for the third signal of head 1 is for whichever is the third in file 1. What a
signal says of itself (head, count, level) must be so.

A file is a chain of lines. Behind a wait its head knows how far the head that signalled was, and
all that one knew then. So a vector clock suffices: for each line, one line number for each head.

References
----------
Mattern 1988, "Virtual time and global states of distributed systems".
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from decmcts.formats.gcode.text.lines import command_of
from decmcts.print.machine import FIELDS, SyncWords

_PROBES = {name: 987_654_001 + k for k, name in enumerate(FIELDS)}  # as no word has them
FILES = 1000  # more than a machine has heads


@dataclass(frozen=True, slots=True)
class Sync:
    """One synchronisation point of a file."""

    line: int  # from 1
    signal: bool  # else a wait
    number: int
    moving: bool = False  # a signal between two moves, for which the head does not stop
    amiss: tuple[str, ...] = ()  # what is wrong with it


class Reader:
    """Reads the sync points of one file in their order; counts its signals."""

    def __init__(self, words: SyncWords, place: int) -> None:
        """Take the machine's words, and the place of the file among all, from 1."""
        self._signal, self._passed, self._wait = (
            _pattern(line) for line in (words.signal, words.passed, words.wait)
        )
        self.begins = tuple(  # of what may be a sync point; few lines of a file begin so
            _begin(line) for line in (words.signal, words.passed, words.wait)
        )
        self._counts = "{number}" not in words.wait
        self._place, self._given = place, 0

    def read(self, line: int, code: bytes, above: bytes) -> Sync | None:
        """Return the sync point that a command in a line is; None: it is another one.

        Where a signal is the same line in motion and at rest, an M400 in the command `above` makes
        the difference. A signal in motion is given when the last move above it ends, so not as late
        as a dwell above it.
        """
        if match := self._wait.fullmatch(code):
            stated = _values(match)
            number = stated["head"] + FILES * stated["count"] if self._counts else stated["number"]
            return Sync(line, False, number)
        stands = above == b"M400"
        rest, moving = self._signal.fullmatch(code), self._passed.fullmatch(code)
        match = rest if rest and (stands or not moving) else moving
        if match is None:
            return None
        self._given += 1
        stated = _values(match)
        due = {"head": self._place, "count": self._given, "level": self._given % 2}
        number = self._place + FILES * self._given if self._counts else stated["number"]
        amiss = [
            f" is signal {self._given} of file {self._place}, not of {name} {stated[name]}"
            for name in due
            if stated.get(name, due[name]) != due[name]
        ]
        if match is rest and not stands:
            amiss.append(": no M400 stands before this signal at rest")
        if match is not rest and above.startswith(b"G4 "):
            amiss.append(": a dwell stands before this signal in motion")
        return Sync(line, True, number, match is not rest, tuple(amiss))


def _pattern(line: str) -> re.Pattern[bytes]:
    """Return what matches a line with any numbers in it, as commands are read."""
    probe = line.format(**_PROBES).encode()
    text = re.escape(command_of(probe)).decode()
    for name, value in _PROBES.items():
        first, *others = text.split(str(value))
        for k, part in enumerate(others):
            first += (rf"(?P<{name}>\d{{1,9}})" if k == 0 else f"(?P={name})") + part
        text = first
    return re.compile(text.encode())


def _begin(line: str) -> bytes:
    """Return how a line begins, as commands are read, up to its first number."""
    probe = command_of(line.format(**_PROBES).encode())
    return min((probe.split(b"%d" % value)[0] for value in _PROBES.values()), key=len)


def _values(match: re.Match[bytes]) -> dict[str, int]:
    return {name: int(value) for name, value in match.groupdict().items()}


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
