"""Changes to the lines of a G-code file, of which mutants are made."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from tests.mutants.catalogue import NotHereError, pick

Lines = list[str]
Files = list[Lines]  # one a head
Rng = np.random.Generator
Spoil = Callable[[Lines, Rng], None]

BEAD = re.compile(r"^G1 X\S+ Y\S+ E\d")
ARC = re.compile(r"^G[23] .*E\d")
TRAVEL = re.compile(r"^G1 X\S+ Y\S+( F\S+)?$")
RETRACT = re.compile(r"^G1 E-")
PRIME = re.compile(r"^G1 E\d")
SIGNAL = re.compile(r"^SYNC_SIGNAL")
PASSED = re.compile(r"^SYNC_PASSED")
WAIT = re.compile(r"^SYNC_WAIT")


def rows_of(lines: Lines, pattern: str | re.Pattern[str]) -> list[int]:
    """Return the rows of the lines that fit a pattern."""
    return [k for k, line in enumerate(lines) if re.search(pattern, line)]


def some_bead(lines: Lines, rng: Rng) -> int:
    """Return the row of a bead."""
    return pick(rows_of(lines, BEAD), rng)


def between(lines: Lines, rng: Rng) -> int:
    """Return a place between two contours: a retraction with beads before and after it."""
    beads = rows_of(lines, BEAD)
    return pick([k for k in rows_of(lines, RETRACT) if beads[0] < k < beads[-1]], rng)


def insert(text: str) -> Spoil:
    """Return a mutant that puts lines between two contours."""

    def spoil(lines: Lines, rng: Rng) -> None:
        at = between(lines, rng)
        lines[at:at] = text.split("\n")

    return spoil


def within(text: str) -> Spoil:
    """Return a mutant that puts lines before a bead."""

    def spoil(lines: Lines, rng: Rng) -> None:
        at = some_bead(lines, rng)
        lines[at:at] = text.split("\n")

    return spoil


def remove(pattern: str | re.Pattern[str], *, all_of_them: bool = False) -> Spoil:
    """Return a mutant that takes out one line, or all, that fit a pattern."""

    def spoil(lines: Lines, rng: Rng) -> None:
        rows = rows_of(lines, pattern)
        rows = rows if all_of_them and rows else [pick(rows, rng)]
        for k in reversed(rows):
            del lines[k]

    return spoil


def change(pattern: str | re.Pattern[str], old: str, new: str) -> Spoil:
    """Return a mutant that rewrites part of one line that fits a pattern."""

    def spoil(lines: Lines, rng: Rng) -> None:
        k = pick([k for k in rows_of(lines, pattern) if re.search(old, lines[k])], rng)
        lines[k] = re.sub(old, new, lines[k], count=1)

    return spoil


def some_contour(lines: Lines, rng: Rng) -> tuple[int, int]:
    """Return where a contour with its priming begins and, past its retraction, ends."""
    primes, retracts = rows_of(lines, PRIME), rows_of(lines, RETRACT)
    k = int(rng.integers(2, len(primes) - 2))
    first = max(j for j in rows_of(lines, TRAVEL) if j < primes[k])
    return first, min(j for j in retracts if j > primes[k]) + 1


def in_one(spoil: Spoil) -> Callable[[Files, Rng], None]:
    """Return a mutant of one head's file, whichever it fits."""

    def spoil_files(files: Files, rng: Rng) -> None:
        for k in rng.permutation(len(files)).tolist():
            try:
                return spoil(files[k], rng)
            except NotHereError:
                continue
        raise NotHereError

    return spoil_files


def moved_earlier(pattern: re.Pattern[str]) -> Spoil:
    """Return a mutant that moves a line to before the contour it stands behind."""
    return _moved(pattern, lambda lines, k: max(j for j in rows_of(lines, BEAD) if j < k))


def moved_later(pattern: re.Pattern[str]) -> Spoil:
    """Return a mutant that moves a line to behind the next bead."""
    return _moved(pattern, lambda lines, k: min(j for j in rows_of(lines, BEAD) if j >= k) + 1)


def _moved(pattern: re.Pattern[str], place: Callable[[Lines, int], int]) -> Spoil:
    """Return a mutant that takes out a line between beads and puts it at its `place` of the rest.

    `place` is given the lines without it, and where it stood.
    """

    def spoil(lines: Lines, rng: Rng) -> None:
        beads = rows_of(lines, BEAD)
        k = pick([k for k in rows_of(lines, pattern) if beads and beads[0] < k < beads[-1]], rng)
        line = lines.pop(k)
        lines.insert(place(lines, k), line)

    return spoil
