"""The temperatures of annealing, and when it ends."""

from __future__ import annotations

from dataclasses import dataclass

DESCENT_FROM = 0.97  # share of a search at which what is drawn at random ends


@dataclass(frozen=True, slots=True)
class TemperatureSchedule:
    """A temperature that falls geometrically, in the unit of costs."""

    first: float
    last: float

    def at(self, share: float) -> float:
        """Return the temperature after `share` (0..1) of the run."""
        return float(self.first * (self.last / self.first) ** min(max(share, 0.0), 1.0))
