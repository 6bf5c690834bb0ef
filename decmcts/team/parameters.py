"""What can be set about one head's search in a team, and what is allowed.

Names are those of Dec-MCTS (Best, Cliff, Patten, Mettu & Fitch 2019, IJRR 38(2-3),
Algs. 1-3) where it has one; `docs/team.md` says what each does. Where values come from
(a file, a launcher) is no business of this module.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from decmcts.formats.fields import Fields, shown
from decmcts.team.plans import POLICIES


@dataclass(frozen=True, slots=True)
class Parameters:
    """Values of the literature and its code, but for what depends on the number of updates.

    The literature does thousands of updates; a print of thousands of contours allows a
    hundred a minute, so steps are longer here and cooling is faster.
    """

    gamma: float = 0.9  # discount of old rewards
    exploration: float = 0.7071067811865476  # C_p
    alpha: float = 0.2  # step of the distribution
    beta: float = 1.0  # temperature at first
    cooling: float = 0.95  # of the temperature, each update
    coldest: float = 0.02  # temperature at last
    plans: int = 10  # |X̂|
    updates: int = 10  # τ, distribution updates of a round
    samples: int = 20  # tree samples of an update
    renew: int = 3  # samples of each plan of X̂ before another X̂ is chosen
    windows: int = 60  # of the best joint order polished in a round
    policies: int = len(POLICIES)  # the first of POLICIES, of which plans name one

    @staticmethod
    def for_contours(n: int) -> Parameters:
        """Return parameters that keep a round to about a second for a print of n contours."""
        samples = int(np.clip(30_000 // max(n, 1), 4, 200))
        updates = min(10, max(2, samples // 10))
        return Parameters(updates=updates, samples=max(2, samples // updates))


# Least and most of each parameter; those with whole limits are whole numbers.
RANGES: Mapping[str, tuple[float, float] | tuple[int, int]] = {
    "gamma": (0.5, 1.0),
    "exploration": (0.0, 10.0),
    "alpha": (0.0, 1.0),
    "beta": (0.001, 100.0),
    "cooling": (0.1, 1.0),
    "coldest": (0.001, 100.0),
    "plans": (1, 100),
    "updates": (0, 100),
    "samples": (1, 1000),
    "renew": (1, 1000),
    "windows": (0, 1000),
    "policies": (1, len(POLICIES)),
}


def changed(
    parameters: Parameters, values: Mapping[str, Any], *, path: Path | str | None = None
) -> Parameters:
    """Return `parameters` with some of them set.

    Parameters
    ----------
    values : Mapping[str, Any]
        By name; the rest stay as they are.
    path : Path | str | None
        The file the values came from, for messages.

    Raises
    ------
    InputError
        For an unknown name and for what is no number within `RANGES`.
    """
    fields = Fields.of(values, "", path)
    fields.only(*RANGES)
    chosen: dict[str, Any] = {key: _allowed(fields, key) for key in values}
    made = replace(parameters, **chosen)
    if made.coldest > made.beta:
        key = "coldest" if "coldest" in values else "beta"
        fields.fail(key, f"coldest {made.coldest:g} is above beta {made.beta:g}, where it begins")
    return made


def _allowed(fields: Fields, key: str) -> float:
    """Return one value, or raise InputError with its limits."""
    value, (least, most) = fields.values[key], RANGES[key]
    kinds, word = (
        ((int,), "a whole number") if isinstance(most, int) else ((int, float), "a number")
    )
    if type(value) not in kinds or not least <= value <= most:
        fields.fail(key, f"expected {word} in {least:g}..{most:g}, found {shown(value)}")
    return value if isinstance(most, int) else float(value)
