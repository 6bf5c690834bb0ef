"""Mutants of a G-code file with scarf seams: contacts that its source does not make.

They spoil lines as `tests.makers.scarf` writes them: a contour from `;TYPE:` on.
"""

from __future__ import annotations

import re

import numpy as np

from tests.mutants.catalogue import Mutant, pick

Lines = list[str]
Rng = np.random.Generator

_BEAD = re.compile(r"^(G1 X\S+ Y\S+ Z\S+) E(\S+)")
_WALL, _SCARF, _INFILL = ";TYPE:Inner wall", ";TYPE:Outer wall", ";TYPE:Sparse infill"


def _span(lines: Lines, first: int) -> slice:
    """Return the rows of the contour that begins at a row."""
    more = (k for k in range(first + 1, len(lines)) if lines[k].startswith("G1 E-"))
    return slice(first, next(more) + 1)


def _scarf(lines: Lines, rng: Rng) -> int:
    return pick([k for k, line in enumerate(lines) if line == _SCARF], rng)


def ramp_before_the_wall(lines: Lines, rng: Rng) -> None:
    """Print the wall that a ramp touches after it."""
    at = _scarf(lines, rng)
    wall = _span(lines, max(k for k in range(at) if lines[k] == _WALL))
    ramp = _span(lines, at)
    lines[wall.start : ramp.stop] = [*lines[ramp], *lines[wall]]


def infill_before_the_ramp(lines: Lines, rng: Rng) -> None:
    """Print the infill before the ramp, which then goes into it as into the wall."""
    ramp = _span(lines, _scarf(lines, rng))
    infill = _span(lines, next(k for k in range(ramp.stop, len(lines)) if lines[k] == _INFILL))
    lines[ramp.start : infill.stop] = [*lines[infill], *lines[ramp]]


def ramp_reversed(lines: Lines, rng: Rng) -> None:
    """Print an outer wall from its end to its ramp."""
    ramp = _span(lines, _scarf(lines, rng))
    rows = [k for k in range(ramp.start, ramp.stop) if _BEAD.match(lines[k])]
    ends = [lines[ramp.start + 2].split(" F")[0] + lines[ramp.start + 3].split(" F")[0][2:]]
    found = [_BEAD.match(lines[k]) for k in rows]
    ends += [match[1] for match in found if match]
    pushed = [match[2] for match in found if match]
    for k, end, e in zip(rows, ends[-2::-1], pushed[::-1], strict=True):
        lines[k] = f"{end} E{e}"
    x, y, z = re.findall(r"[XYZ]\S+", ends[-1])
    lines[ramp.start + 2] = f"G1 {x} {y} F9000"
    lines[ramp.start + 3] = f"G1 {z} F720"


def deeper_first(lines: Lines, rng: Rng) -> None:
    """Go deeper beside the wall before the ramp begins."""
    at = _scarf(lines, rng) + 3
    z = float(lines[at].split()[1][1:])
    lines.insert(at, f"G1 Z{z - 0.08:.3f} F720")


def along_the_wall(lines: Lines, rng: Rng) -> None:
    """Travel to the ramp at its height, through the wall inside."""
    at = _scarf(lines, rng) + 2
    x, y = (float(word[1:]) for word in re.findall(r"[XY]\S+", lines[at]))
    z = lines[at + 1].split()[1]
    lines[at + 1 : at + 2] = [f"G1 X{x - 3.0:.3f} Y{y:.3f} F9000", f"G1 {z} F720", lines[at]]


CONTACT_MUTANTS: tuple[Mutant[Lines], ...] = (
    Mutant("the ramp before the wall it touches", ramp_before_the_wall),
    Mutant("the ramp into another bead", infill_before_the_ramp),
    Mutant("the ramp reversed", ramp_reversed),
    Mutant("a contact deeper than the source's", deeper_first),
    Mutant("a travel through the wall at the ramp's height", along_the_wall),
)
