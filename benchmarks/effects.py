"""What a part of a search is worth: a variant's cost against the whole search and its twin.

A twin is the whole search with another seed, so what the two differ by is noise.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Effect:
    """How much more a variant costs than the whole search and its twin, with one seed."""

    more_percent: float
    noise: float  # how far apart the whole search and its twin are, per cent


def against_twins(costs: Mapping[str, float], whole: str) -> dict[str, Effect]:
    """Return each variant's effect, of the costs of `whole`, "twin" and others; {} without both."""
    if not {whole, "twin"} <= set(costs):
        return {}
    base = (costs[whole] + costs["twin"]) / 2
    apart = 100 * (costs[whole] - costs["twin"]) / base if base else 0.0
    return {
        variant: Effect(100 * (cost / base - 1) if base else 0.0, apart)
        for variant, cost in costs.items()
    }


def mean_and_doubt(them: list[Effect]) -> tuple[float, float]:
    """Return the mean effect, and within what a variant that changes nothing would mostly stay.

    That is two standard errors: a run varies by 1/√2 of what twins are apart by, the mean
    of the whole search and its twin by half of that variance.
    """
    mean = statistics.fmean(effect.more_percent for effect in them)
    doubt = 2 * math.sqrt(0.75 * sum(effect.noise**2 for effect in them)) / len(them)
    return mean, doubt


def told(them: list[Effect]) -> str:
    """Return mean ± doubt, bold where the mean is beyond it; nothing without effects."""
    if not them:
        return ""
    mean, doubt = mean_and_doubt(them)
    text = f"{mean:+.2f} ± {doubt:.2f}"
    return f"**{text}**" if abs(mean) > doubt else text
