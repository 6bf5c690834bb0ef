"""When a search ends. Criteria are asked; they hold no counters of their own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Progress:
    """Where a search stands."""

    seconds: float  # since the start of the search
    iterations: int
    cost: float  # of the best sequence so far, in the problem's unit
    improved_at_s: float  # when that sequence was found
    bound: float | None = None  # no sequence costs less, if known


class StoppingCriterion(Protocol):
    """Says whether the search ends now."""

    def __call__(self, progress: Progress) -> bool:
        """Return True to end the search."""
        ...


@dataclass(frozen=True, slots=True)
class TimeLimit:
    """Ends after so many seconds."""

    seconds: float

    def __call__(self, progress: Progress) -> bool:
        """Return True when the time is used up."""
        return progress.seconds >= self.seconds


@dataclass(frozen=True, slots=True)
class IterationLimit:
    """Ends after so many iterations."""

    iterations: int

    def __call__(self, progress: Progress) -> bool:
        """Return True when the iterations are used up."""
        return progress.iterations >= self.iterations


@dataclass(frozen=True, slots=True)
class NoImprovement:
    """Ends when nothing better was found for so many seconds (the paper's rule)."""

    seconds: float

    def __call__(self, progress: Progress) -> bool:
        """Return True when the last improvement is long ago."""
        return progress.seconds - progress.improved_at_s >= self.seconds


@dataclass(frozen=True, slots=True)
class Asked:
    """Ends when somebody outside asks for it, e.g. Ctrl-C."""

    stop: Callable[[], bool]

    def __call__(self, progress: Progress) -> bool:
        """Return True when asked to stop."""
        return self.stop()


@dataclass(frozen=True, slots=True)
class AnyOf:
    """Ends as soon as one of several criteria does."""

    criteria: tuple[StoppingCriterion, ...]

    def __call__(self, progress: Progress) -> bool:
        """Return True when any criterion holds."""
        return any(criterion(progress) for criterion in self.criteria)


@dataclass(frozen=True, slots=True)
class Budget:
    """How much a search may use, for planners that pace themselves by it."""

    seconds: float
    iterations: int | None = None  # when set, pace is kept by iterations and is repeatable

    def spent(self, seconds: float, iterations: int) -> float:
        """Return the share used, 0 at the start, 1 or more at the end."""
        if self.iterations is not None:
            return iterations / self.iterations if self.iterations else 1.0
        return seconds / self.seconds if self.seconds > 0.0 else 1.0
