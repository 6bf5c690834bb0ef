"""Mutants: ways to spoil a good result, each with what a judge must make of it.

A mutant changes a result in place, so that it is wrong, or says why the change does
no harm. What the changes are stands in `mutants_plan`, `mutants_gcode` and
`mutants_heads`; `benchmarks/mutations.py` tries them all.

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
    sealed: bool = False  # the digest is made anew, as one would who hides a change


def pick(choices: list[int], rng: np.random.Generator) -> int:
    """Return one of the choices; raises NotHereError where there is none."""
    if not choices:
        raise NotHereError
    return choices[int(rng.integers(len(choices)))]
