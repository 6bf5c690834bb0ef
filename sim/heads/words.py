"""Sync points as the judge reads them, by the words of a machine.

A number stands in the line, or else it is made of the head that gives it and of how many it has
given: then a wait for the third signal of head 1 is for whichever is the third in file 1. What a
signal says of itself (head, count, level) must be so.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from decmcts.formats.gcode.text.lines import command_of
from decmcts.print.sync_words import FIELDS, SyncWords

_PROBES = {name: 987_654_001 + k for k, name in enumerate(FIELDS)}  # as no word has them
FILES = 1000  # more than a machine has heads


@dataclass(frozen=True, slots=True)
class Read:
    """A sync point."""

    signal: bool  # else a wait
    moving: bool  # a signal in motion
    number: int
    amiss: tuple[str, ...] = ()  # what it says of itself and is not so


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

    def read(self, code: bytes, *, stands: bool) -> Read | None:
        """Return the sync point a command is; None: it is another one.

        `stands` tells whether an M400 is right above it: where a signal is the same line in motion
        and at rest, that makes the difference.
        """
        if not code.startswith(self.begins):
            return None
        if match := self._wait.fullmatch(code):
            said = _values(match)
            number = said["head"] + FILES * said["count"] if self._counts else said["number"]
            return Read(False, False, number)
        rest, moving = self._signal.fullmatch(code), self._passed.fullmatch(code)
        match = rest if rest and (stands or not moving) else moving
        if match is None:
            return None
        self._given += 1
        said, due = _values(match), self._due()
        number = self._place + FILES * self._given if self._counts else said["number"]
        amiss = (
            f"is signal {self._given} of file {self._place}, not of {name} {said[name]}"
            for name in due
            if said.get(name, due[name]) != due[name]
        )
        return Read(True, match is not rest, number, tuple(amiss))

    def _due(self) -> dict[str, int]:
        return {"head": self._place, "count": self._given, "level": self._given % 2}


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
