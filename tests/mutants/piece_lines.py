"""Mutants of the heads' files of a cut print: lines of pieces."""

from __future__ import annotations

import re
from itertools import pairwise

from tests.mutants.catalogue import Mutant, NotHereError, pick
from tests.mutants.gcode_lines import Files, Lines, Rng, Spoil, change, in_one, rows_of
from tests.mutants.heads import HEAD_MUTANTS

PIECE = re.compile(r"^; next contour")
PRINTS = re.compile(r"^G1 X(\S+) Y(\S+) E(\d\S*)(.*)$")
HOP = re.compile(r"^G1 X(\S+) Y(\S+) F\S+$")


def _bounds(lines: Lines, rng: Rng) -> tuple[int, int]:
    """Return from which line to which a piece is printed, the next one's begin excluded."""
    marks = rows_of(lines, PIECE)
    spans = [
        (a + 1, b) for a, b in pairwise(marks)
        if any(PRINTS.match(line) for line in lines[a + 1 : b])
    ]  # fmt: skip
    return spans[pick(list(range(len(spans))), rng)]


def _prints(lines: Lines, rng: Rng) -> list[int]:
    """Return the lines of a piece that print."""
    first, last = _bounds(lines, rng)
    return [k for k in range(first, last) if PRINTS.match(lines[k])]


def piece_dropped(lines: Lines, rng: Rng) -> None:
    """Leave out what a piece prints."""
    for k in reversed(_prints(lines, rng)):
        del lines[k]


def piece_doubled(lines: Lines, rng: Rng) -> None:
    """Print a piece again, from where it ends."""
    rows = _prints(lines, rng)
    lines[rows[-1] + 1 : rows[-1] + 1] = [lines[k] for k in rows]


def piece_scaled(lines: Lines, rng: Rng) -> None:
    """Push 2 % more filament in all of a piece."""
    for k in _prints(lines, rng):
        lines[k] = _with_filament(lines[k], 1.02)


def _with_filament(line: str, factor: float, more: float = 0.0) -> str:
    match = PRINTS.match(line)
    if match is None:
        raise NotHereError
    x, y, e, rest = match.groups()
    return f"G1 X{x} Y{y} E{factor * float(e) + more:.5f}{rest}"


def filament_moved(lines: Lines, rng: Rng) -> None:
    """Push filament of a piece's last bead in the first of the next."""
    beads = [k for k in range(len(lines)) if PRINTS.match(lines[k])]
    ends = [(a, b) for a, b in pairwise(beads)
            if any(PIECE.match(line) for line in lines[a:b])]  # fmt: skip
    a, b = ends[pick(list(range(len(ends))), rng)]
    lines[a], lines[b] = _with_filament(lines[a], 1.0, -2e-3), _with_filament(lines[b], 1.0, 2e-3)


def to_the_other(files: Files, rng: Rng) -> None:
    """Let the other head print a piece, behind one of its own."""
    rows = _prints(files[0], rng)
    moved = [files[0][k] for k in rows]
    for k in reversed(rows):
        del files[0][k]
    at = _prints(files[1], rng)[-1]
    files[1][at + 1 : at + 1] = moved


def hop_printed(lines: Lines, rng: Rng) -> None:
    """Push filament in a hop within a piece."""
    k = pick([k for k in rows_of(lines, HOP) if k and PRINTS.match(lines[k - 1])
              and k + 1 < len(lines) and PRINTS.match(lines[k + 1])], rng)  # fmt: skip
    lines[k] = re.sub(r" F", " E0.01000 F", lines[k])


def _within(text: str) -> Spoil:
    """Return a mutant that puts a line in the middle of a piece."""

    def spoil(lines: Lines, rng: Rng) -> None:
        lines.insert(_prints(lines, rng)[-1], text)

    return spoil


# Not "waits exchanged": to wait for the later of two signals first is a deadlock, or does no harm.
TAKEN = (
    "a contour given to the other head", "a wait dropped", "all waits dropped",
    "a signal too soon", "another number waited for", "a bead dropped",
    "a bead twice", "more filament", "a bead a little elsewhere", "another feed",
    "a travel through the print", "files exchanged", "cut off in the middle", "a comment more",
)  # fmt: skip
PIECE_LINE_MUTANTS: tuple[Mutant[Files], ...] = (
    Mutant("lines of a piece dropped", in_one(piece_dropped)),
    Mutant("lines of a piece doubled", in_one(piece_doubled)),
    Mutant("filament of a piece scaled", in_one(piece_scaled)),
    Mutant("filament of a piece pushed in the next", in_one(filament_moved)),
    Mutant("lines of a piece in the other head's file", to_the_other),
    Mutant("a hop printed", in_one(hop_printed)),
    Mutant("another fan within a piece", in_one(_within("M106 S33"))),
    Mutant("another temperature within a piece", in_one(_within("M104 S231"))),
    Mutant("a push on the spot within a piece", in_one(_within("G1 E0.10000 F2400"))),
    Mutant("another feed from a piece on", in_one(change(PRINTS, r"F\d+$", "F900"))),
    *(mutant for mutant in HEAD_MUTANTS if mutant.name in TAKEN),
)
