"""Mutants: ways to spoil a good result, each with what a judge must make of it.

A mutant changes a result in place. The result is then wrong, unless the mutant states why the
change is harmless. Changes of plans are in `plan` (with `actions` and
`waits`). Those of files are made of `gcode_lines`: `gcode`, `contacts`,
`dots`, `tools`, and `heads` for several heads. `benchmarks/mutations.py`
tries them all. Those of cut prints are `cuts`, `pieces` (made of `cut_rows`) and
`piece_lines`; `benchmarks/cut_plans.py` makes thousands of them.

References
----------
DeMillo, Lipton, Sayward 1978, "Hints on test data selection" (mutation testing).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

Result = TypeVar("Result")


class NotHereError(Exception):
    """The result has no place where this mutant could be made."""


@dataclass(frozen=True, slots=True)
class Mutant(Generic[Result]):
    """One way to spoil a result of one kind."""

    name: str
    spoil: Callable[[Result, np.random.Generator], None]  # changes the result in place
    harmless: str = ""  # why a judge may let it pass; empty: it must not
    sealed: bool = False  # whether the digest is made anew, as by someone who hides a change


def pick(choices: list[int], rng: np.random.Generator) -> int:
    """Return one of the choices; raises NotHereError where there is none."""
    if not choices:
        raise NotHereError
    return choices[int(rng.integers(len(choices)))]
