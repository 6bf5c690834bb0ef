"""Mutants of dots and vertical beads, as `decmcts` writes those of `made_dots_gcode`."""

from __future__ import annotations

import re

from tests.mutants.catalogue import Mutant, NotHereError, pick
from tests.mutants.gcode_lines import BEAD, Files, Lines, Rng, Spoil, change, in_one, rows_of

DOT = re.compile(r"^G1 E1\.50000 F100$")
PILLAR = re.compile(r"^G1 Z2\.300 E0\.40000")


def instead(pattern: re.Pattern[str], *texts: str) -> Spoil:
    """Return a mutant that writes other lines for one; '@' stands for the line itself."""

    def spoil(lines: Lines, rng: Rng) -> None:
        k = pick(rows_of(lines, pattern), rng)
        lines[k : k + 1] = [text.replace("@", lines[k]) for text in texts]

    return spoil


def pillar_before_its_foot(lines: Lines, rng: Rng) -> None:
    """Print a pillar before all beads, the line that it stands on among them."""
    k = pick(rows_of(lines, PILLAR), rng)
    begin = max(j for j in range(k) if lines[j].startswith("G1 X"))
    beads = [j for j in rows_of(lines, BEAD) if j < begin]
    if not beads:
        raise NotHereError
    above = beads[0] - 3  # the travel to the first bead
    pillar = lines[begin : k + 2]
    rest = [*lines[:begin], *lines[k + 2 :]]
    lines[:] = [*rest[:above], *pillar, "G1 Z5.300 F600", *rest[above:]]


def filament_exchanged(lines: Lines, rng: Rng) -> None:
    """Let a dot have a tenth less, and the next a tenth more."""
    rows = rows_of(lines, DOT)
    k = pick(list(range(len(rows) - 1)), rng)
    for row, filament in ((rows[k], "1.40000"), (rows[k + 1], "1.60000")):
        lines[row] = lines[row].replace("1.50000", filament)


def dot_to_the_other(files: Files, rng: Rng) -> None:
    """Push a head's dot with the other head, where that has one of its own."""
    taken = pick(rows_of(files[0], DOT), rng)
    files[1].insert(pick(rows_of(files[1], DOT), rng), files[0].pop(taken))


DOT_MUTANTS: tuple[Mutant[Lines], ...] = (
    Mutant("a dot dropped", instead(DOT)),
    Mutant("a dot doubled", instead(DOT, "@", "@")),
    Mutant("a dot moved", instead(DOT, "G1 X80 F9000", "@")),
    Mutant("a dot a little higher", instead(DOT, "G1 Z0.700 F600", "@")),
    Mutant("more filament in a dot", change(DOT, r"E1\.5", "E1.7")),
    Mutant("a dot's filament in the next", filament_exchanged),
    Mutant("a dot at another feed", change(DOT, "F100", "F200")),
    Mutant("a dot made a restart", instead(DOT, "@", "G1 E-1.50000 F100")),
    Mutant("a pillar dropped", instead(PILLAR)),
    Mutant("a pillar without filament", change(PILLAR, r" E0\.40000", "")),
    Mutant(
        "a pillar printed downward", instead(PILLAR, "G1 Z2.300 F600", "G1 Z0.300 E0.40000 F200")
    ),
    Mutant("a pillar twice", instead(PILLAR, "@", "G1 Z0.300", "@")),
    Mutant("a pillar less high", change(PILLAR, r"Z2\.300", "Z2.000")),
    Mutant("a pillar before its foot", pillar_before_its_foot),
)

HEAD_DOT_MUTANTS: tuple[Mutant[Files], ...] = (
    *(Mutant(one.name, in_one(one.spoil)) for one in DOT_MUTANTS),
    Mutant("a dot given to the other head", dot_to_the_other),
)
