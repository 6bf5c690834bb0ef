"""How far from optimal a result is at most: the certificate's part in planning one head.

The bound itself is made in `decmcts.search.bounds.certificate`; here is how long it may
take and for which prints it is tried.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from decmcts.planning.compiling.rows import row_of
from decmcts.print.metrics import Metrics
from decmcts.search.bounds.certificate import EXACT_UP_TO, lower_bound
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping

MOST_S = 10.0  # for the bound
MOST_EARLY_S = 3.0  # for the bound shown while searching
EARLY_SHARE = 0.05  # of the search time, for that one
EARLY_FROM_S = 3.0  # a shorter search ends before one could read it, and making it takes 0.2 s
SHARE = 0.5  # of the search time, for the bound of a plan
WORDS_PER_S = 2e6  # words of 64 relations handled in a second, on a slow computer
MOST_BYTES = 2 * 2**30  # of relations
ROUNDING = 1e-9  # of a travel: what lies no further from it is the same


@dataclass(frozen=True, slots=True)
class Certificate:
    """How far from optimal the travels of an order are at most."""

    travel: float  # what they cost, in `unit`
    bound: float | None  # no order's cost less; None where nothing was proven
    gap_percent: float | None  # how far above the optimum the travels are at most
    unit: str  # "mm" or "s"
    method: str = ""  # how it was proven
    skipped: str = ""  # why nothing was proven

    def metrics(self) -> Metrics:
        """Return what a plan's metrics say of it."""
        said: Metrics = {"bound_mm": self.bound}
        if self.unit == "s":
            said = {"travel_s": self.travel, "bound_s": self.bound}
        said["gap_percent"] = self.gap_percent
        if self.skipped:
            return {**said, "bound_skipped": self.skipped}
        return {**said, "bound_method": self.method}

    @staticmethod
    def of(metrics: Metrics) -> Certificate | None:
        """Return what a plan's metrics say of it; None where they say nothing."""
        if "bound_s" in metrics:
            travel, bound, unit = metrics["travel_s"], metrics["bound_s"], "s"
        elif "bound_mm" in metrics:
            travel, bound, unit = metrics["extrusionless_travel_mm"], metrics["bound_mm"], "mm"
        else:
            return None
        method, skipped = metrics.get("bound_method", ""), metrics.get("bound_skipped", "")
        return Certificate(travel, bound, metrics["gap_percent"], unit, method, skipped)


def certify(
    problem: OrderProblem,
    travel: float,
    *,
    stopping: Stopping,
    known: float | None = None,
) -> Certificate:
    """Prove how far from optimal a result is at most, or say why that is not known.

    Parameters
    ----------
    travel : float
        What the result's travels cost, mm or s as the problem has it.
    stopping : Stopping
        What ends the proof with what is proven by then; at the latest `MOST_S` do.
    known : float | None
        What the search itself has proven; no lower bound is returned. If it is the
        travel, no more is done.
    """
    allowed_s, unit = stopping.seconds_up_to(MOST_S), problem.unit
    if known is not None and travel <= known * (1.0 + ROUNDING):
        return Certificate(travel, known, 0.0, unit, "exact")
    asked = "stopped before one was proven" if stopping.is_asked() else ""
    if reason := asked or _too_large(len(problem), allowed_s):
        return Certificate(travel, None, None, unit, skipped=reason)
    compile_bound(problem)
    stopping = replace(stopping, seconds=allowed_s)
    found = lower_bound(problem, stopping=stopping, upper_bound=travel)
    method: str = found.method
    if known is not None and known > found.bound:
        found, method = replace(found, bound=known), "search"
    return Certificate(travel, found.bound, found.gap_percent(travel), unit, method)


def early_bound(problem: OrderProblem, *, stopping: Stopping) -> float | None:
    """Return a bound to show while searching, made in a twentieth of what the search has."""
    allowed_s = stopping.shortened(EARLY_SHARE).seconds_up_to(MOST_EARLY_S)
    if len(problem) <= EXACT_UP_TO or _too_large(len(problem), allowed_s):
        return None
    compile_bound(problem)
    return lower_bound(problem, stopping=Stopping(allowed_s, asked=stopping.asked)).bound


def _too_large(n: int, allowed_s: float) -> str:
    """Return why a print is too large for the time, or nothing."""
    words = n * (n / 64)
    if 2 * 8 * words > MOST_BYTES:
        return f"{n} contours need more than {MOST_BYTES / 2**30:.0f} GiB of memory"
    if n > EXACT_UP_TO and words / WORDS_PER_S > allowed_s:
        return f"{n} contours need more than {allowed_s:.1f} s (half of --time-limit, at most 10 s)"
    return ""


def compile_bound(problem: OrderProblem) -> None:
    """Bound prints of no size, one exactly, so that compiling is off the clock."""
    for n in (3, EXACT_UP_TO + 1):
        lower_bound(replace(row_of(n), pace=problem.pace), stopping=Stopping(seconds=0.0))
