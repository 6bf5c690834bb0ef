"""How far from optimal a result is at most: the certificate of a plan for one head.

The bound itself is proven in `decmcts.search.bounds.certificate`. Here is how long that may
take, and for which prints it is tried.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from decmcts.planning.compiling import bound_part, is_compiled, unit_for
from decmcts.planning.events import Report, Step
from decmcts.planning.one_head.order_search import row_of
from decmcts.planning.options import Search
from decmcts.print.metrics import Metrics
from decmcts.search.bounds.certificate import EXACT_UP_TO, lower_bound
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping

MOST_S = 10.0  # for the bound of a plan
MOST_EARLY_S = 3.0  # for the bound shown while searching
EARLY_SHARE = 0.05  # of the search time, for that one
EARLY_FROM_S = 3.0  # a shorter search ends before one could read it, and making it takes 0.2 s
SHARE = 0.5  # of the search time, for the bound of a plan
WORDS_PER_S = 2e6  # words of 64 relations handled in a second, on a slow computer
MOST_BYTES = 2 * 2**30  # of relations
ROUNDING = 1e-9  # share of a travel; costs that differ by no more are equal


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
        """Return the certificate as entries of a plan's metrics."""
        stated: Metrics = {"bound_mm": self.bound}
        if self.unit == "s":
            stated = {"travel_s": self.travel, "bound_s": self.bound}
        stated["gap_percent"] = self.gap_percent
        if self.skipped:
            return {**stated, "bound_skipped": self.skipped}
        return {**stated, "bound_method": self.method}

    @staticmethod
    def of(metrics: Metrics) -> Certificate | None:
        """Return the certificate in a plan's metrics; None where there is none."""
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
    most_s: float = MOST_S,
) -> Certificate:
    """Prove how far from optimal a result is at most, or say why that is not known.

    `travel` is what the result's travels cost, in the unit of the problem that was searched.
    `stopping`, and `most_s` at the latest, end the proof with what is proven by then. `known` is
    a bound that the search itself has proven; if it equals the travel nothing else is tried.
    """
    allowed_s, unit = stopping.seconds_up_to(most_s), problem.unit
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


def early_bound(
    problem: OrderProblem, search: Search, stopping: Stopping, report: Report
) -> float | None:
    """Return a bound to show while searching, made in a twentieth of what the search has.

    None where there is no time for it, or where its kernels are not compiled yet.
    """
    early = search.certificate and search.time_limit_s >= EARLY_FROM_S
    if not (early and is_compiled(bound_part(unit_for(problem)))) or stopping.is_asked():
        return None
    report(Step("a first bound on the travel"))
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
        return f"{n} contours need more than the {allowed_s:.1f} s that a bound may take here"
    return ""


def compile_bound(problem: OrderProblem) -> None:
    """Bound tiny problems, one of them exactly, so that compiling takes no time from the bound."""
    for n in (3, EXACT_UP_TO + 1):
        lower_bound(replace(row_of(n), pace=problem.pace), stopping=Stopping(seconds=0.0))
