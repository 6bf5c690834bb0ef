"""What can be set about one head's search in a team, and what is allowed.

Names are those of Dec-MCTS (Best, Cliff, Patten, Mettu & Fitch 2019, IJRR 38(2-3),
Algs. 1-3) where it has one; `docs/team.md` says what each does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from decmcts.formats.files.fields import Fields, shown
from decmcts.formats.files.reading import read_toml
from decmcts.team.dec_mcts.polish import FEW
from decmcts.team.engine.plans import POLICIES

# Of a round, for trees, where they gain less than windows: of an order that is annealed as a
# whole, and of one that begins ahead of all policies.
SMALL_SHARE = 0.05


@dataclass(frozen=True, slots=True)
class Parameters:
    """Values of the literature and its code, but for what depends on the number of samples.

    The literature does thousands of updates; a print of thousands of contours allows tens a
    minute, so steps are longer here and cooling is faster.
    """

    gamma: float = 0.9  # discount of old rewards
    exploration: float = 0.7071067811865476  # C_p
    alpha: float = 0.2  # step of the distribution
    beta: float = 0.5  # temperature of the distribution at first, in the range of X̂
    cooling: float = 0.7  # of beta, each update
    coldest: float = 0.05  # beta at last
    plans: int = 10  # |X̂|
    samples: int = 10  # tree samples of an update
    renew: int = 3  # samples of each plan of X̂ before another X̂ is chosen
    first: float = 0.4  # of the time, for tree and distribution before windows are improved
    recreate: float = 0.7  # of the time, till when windows are ruined and recreated
    share: float = 0.3  # of a round's work, for tree and distribution from then on
    windows: int = 60  # of the best joint order recreated or polished in a round
    tries: int = 32  # policies that all heads together try at first

    @staticmethod
    def for_contours(n: int) -> Parameters:
        """Return parameters for a print of n contours: the larger, the fewer samples.

        There are fewer windows in a round, too, since each takes longer; so rounds stay short.
        On very large prints polishing gains more than all before it, so it begins sooner. A few
        contours are annealed all together, for nearly all the time.
        """
        plans = int(np.clip(40_000 // max(n, 1), 5, 10))
        tries = int(np.clip(200_000 // max(n, 1), 32, 128))
        windows = int(np.clip(900_000 // max(n, 1), 20, 60))
        first = float(np.clip(8_000 / max(n, 1), 0.2, 0.4))
        recreate = float(np.clip(14_000 / max(n, 1), 0.3, 0.7))
        made = Parameters(
            plans=plans, samples=plans // 2, tries=tries, windows=windows, first=first,
            recreate=recreate,
        )  # fmt: skip
        return replace(made, share=SMALL_SHARE) if n <= FEW else made


# Least and most of each parameter; where these are integers the parameter is one, too.
RANGES: Mapping[str, tuple[float, float] | tuple[int, int]] = {
    "gamma": (0.5, 1.0),
    "exploration": (0.0, 10.0),
    "alpha": (0.0, 1.0),
    "beta": (0.001, 100.0),
    "cooling": (0.1, 1.0),
    "coldest": (0.001, 100.0),
    "plans": (1, 100),
    "samples": (1, 1000),
    "renew": (1, 1000),
    "first": (0.0, 1.0),
    "recreate": (0.0, 1.0),
    "share": (0.0, 1.0),
    "windows": (0, 1000),
    "tries": (1, len(POLICIES)),
}


def changed(
    parameters: Parameters, values: Mapping[str, object], *, path: Path | str | None = None
) -> Parameters:
    """Return `parameters` with some of them set.

    Parameters
    ----------
    values : Mapping[str, object]
        By name; the rest stay as they are.
    path : Path | str | None
        The file the values came from, for messages.

    Raises
    ------
    InputError
        For an unknown name, and for what is no number within `RANGES`.
    """
    fields = Fields.of(values, "", path)
    fields.only(*RANGES)
    chosen: dict[str, Any] = {key: _allowed(fields, key) for key in values}
    made = replace(parameters, **chosen)
    if made.coldest > made.beta:
        key = "coldest" if "coldest" in values else "beta"
        fields.fail(key, f"coldest {made.coldest:g} is above beta {made.beta:g}, where it begins")
    return made


def read_parameters(path: Path) -> Mapping[str, float]:
    """Return the parameters that a TOML file sets; raises InputError for unknown or bad ones."""
    values = read_toml(path, "file of parameters", page="docs/team.md")
    changed(Parameters(), values, path=path)
    return values


def _allowed(fields: Fields, key: str) -> float:
    """Return one value, or raise InputError with its limits."""
    value, (least, most) = fields.values[key], RANGES[key]
    kinds, word = (
        ((int,), "a whole number") if isinstance(most, int) else ((int, float), "a number")
    )
    if type(value) not in kinds or not least <= value <= most:
        fields.fail(key, f"expected {word} in {least:g}..{most:g}, found {shown(value)}")
    return value if isinstance(most, int) else float(value)
