"""Mutants of files with temperatures, and of prints that were made safe.

The former are of the made print, which is cooler from its second layer on. The latter are of parts
that the source prints one by one, too near each other, and that were planned layer by layer.
"""

from __future__ import annotations

import re

import numpy as np

from tests.makers.one_by_one import COOLER, one_by_one
from tests.mutants.catalogue import Mutant, NotHereError
from tests.mutants.gcode_lines import Lines, change, insert, moved_earlier, moved_later, remove

Rng = np.random.Generator

_COOLER = re.compile(r"^M104 S205")
PARTS = 3  # of the print that was made safe


def made_unsafe() -> str:
    """Return parts one by one, hotter in their first layers."""
    return one_by_one(PARTS, later=COOLER)


def in_its_own_order(lines: Lines, rng: Rng) -> None:
    """Print one part after the other, as the source does."""
    lines[:] = ["; spoilt", *made_unsafe().splitlines()]


def labels_exchanged(lines: Lines, rng: Rng) -> None:
    """Let two parts have each other's label: who cancels one loses the other."""
    text = "\n".join(lines)
    if "printing object 0" not in text or "printing object 1" not in text:
        raise NotHereError
    text = text.replace("object 0", "object @").replace("object 1", "object 0")
    lines[:] = text.replace("object @", "object 1").split("\n")


def part_first(lines: Lines, rng: Rng) -> None:
    """Finish the first part's second layer before the others' first."""
    rows = [k for k, line in enumerate(lines) if line.startswith("; printing object")]
    high = [k for k in rows if "; printing object 0" in lines[k]][1:]
    low = [k for k in rows if k < min(high, default=0) and "; printing object 0" not in lines[k]]
    if not high or not low:
        raise NotHereError
    end = min([k for k in rows if k > high[0]], default=len(lines))
    moved = lines[high[0] : end]
    del lines[high[0] : end]
    lines[low[0] : low[0]] = moved


TEMPERATURE_MUTANTS: tuple[Mutant[Lines], ...] = (
    Mutant("another temperature", change(_COOLER, "S205", "S206")),
    Mutant("a temperature of another tool", change(_COOLER, "S205", "S205 T1")),
    Mutant("a temperature of the bed", change(_COOLER, "M104", "M140")),
    Mutant("a temperature a bead too soon", moved_earlier(_COOLER)),
    Mutant("a temperature a bead too late", moved_later(_COOLER)),
    Mutant("a temperature given up again", insert("M104 S210")),
)
SAFE_MUTANTS: tuple[Mutant[Lines], ...] = (
    *TEMPERATURE_MUTANTS,
    Mutant("a temperature line gone", remove(_COOLER)),
    Mutant("the source's own order", in_its_own_order),
    Mutant("the labels of two parts exchanged", labels_exchanged),
    Mutant("one part a layer ahead", part_first),
    Mutant("a temperature between parts", insert("M104 S215")),
    Mutant("another fan speed between parts", change(r"^M106", r"S\d+", "S13")),
)
