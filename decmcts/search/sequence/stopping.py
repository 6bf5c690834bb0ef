"""When a search ends, and how much of it is over: one value, made once for the whole search.

Annealing's temperatures follow from it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

POLL_S = 0.1  # how often a search looks whether it is to end


@dataclass(frozen=True, slots=True)
class Progress:
    """Where a search stands."""

    seconds: float  # since the start of the search
    iterations: int
    cost: float  # of the best sequence so far, in the problem's unit
    improved_at_s: float  # when that sequence was found
    bound: float | None = None  # no sequence costs less, if known


@dataclass(frozen=True, slots=True)
class Stopping:
    """When a search ends: at the first of the limits that are given, or when asked to.

    Planners divide their work by the share that is spent: of the iterations where these are
    limited, else of the seconds. So one of the two limits is needed. Where iterations are
    limited and nothing else ends the search, equal seeds give equal results.

    Parameters
    ----------
    seconds : float | None
        By the clock of the search; None: no limit.
    iterations : int | None
        As the planner counts them: sequences, rollouts or moves tried; None: no limit.
    asked : Callable[[], bool] | None
        Polled several times a second; True ends the search, for example on Ctrl-C.

    Raises
    ------
    ValueError
        If there is neither a limit of seconds nor of iterations, or one is negative or
        infinite: then there would be no share of it to pace the search by.
    """

    seconds: float | None = None
    iterations: int | None = None
    asked: Callable[[], bool] | None = None

    def __post_init__(self) -> None:
        if self.seconds is None and self.iterations is None:
            raise ValueError("a search needs a limit of seconds or iterations to pace itself by")
        if self.seconds is not None and not 0.0 <= self.seconds < math.inf:
            raise ValueError(f"limit of {self.seconds} s, must be finite and at least 0")
        if self.iterations is not None and self.iterations < 0:
            raise ValueError(f"limit of {self.iterations} iterations, must be at least 0")

    def ends(self, seconds: float, iterations: int) -> bool:
        """Return whether the search ends here."""
        return (
            (self.seconds is not None and seconds >= self.seconds)
            or (self.iterations is not None and iterations >= self.iterations)
            or self.is_asked()
        )

    def is_asked(self) -> bool:
        """Return whether somebody asks for the end, whatever the limits are."""
        return self.asked is not None and self.asked()

    def spent(self, seconds: float, iterations: int) -> float:
        """Return the share used, 0 at the start, 1 or more at the end."""
        if self.iterations is not None:
            return iterations / self.iterations if self.iterations else 1.0
        assert self.seconds is not None
        return seconds / self.seconds if self.seconds > 0.0 else 1.0

    def share_of(self, seconds: float) -> float:
        """Return which share of the limit these seconds are; 0 where iterations are limited."""
        return self.spent(seconds, 0)

    def seconds_up_to(self, most: float) -> float:
        """Return the limit of seconds; `most` where that is less, or there is no limit."""
        return most if self.seconds is None else min(most, self.seconds)

    def shortened(self, share: float) -> Stopping:
        """Return the same with a share of the seconds; a limit of iterations stays."""
        return self if self.seconds is None else replace(self, seconds=share * self.seconds)


def next_chunk(size: int, took_s: float, goal_s: float, *, least: int, most: int) -> int:
    """Return how much work takes about `goal_s`, where `size` of it `took_s`.

    At most four times as much, since one measurement may be off.
    """
    speed = size / max(took_s, 1e-6)
    return int(min(max(goal_s * speed, least), max(4.0 * size, least), most))


DESCENT_FROM = 0.97  # share of a search at which what is drawn at random ends


@dataclass(frozen=True, slots=True)
class TemperatureSchedule:
    """A temperature that falls geometrically, in the unit of costs."""

    first: float
    last: float

    def at(self, share: float) -> float:
        """Return the temperature after `share` (0..1) of the run."""
        return float(self.first * (self.last / self.first) ** min(max(share, 0.0), 1.0))
