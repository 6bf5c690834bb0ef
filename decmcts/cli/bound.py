"""How far from optimal a result is at most: the certificate's part in planning one head.

The bound itself is made in `decmcts.search.bounds.certificate`; here is how long it may
take, for which prints it is tried, and how it is put.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from decmcts.feasibility.graph import DependencyGraph
from decmcts.search.bounds.certificate import EXACT_UP_TO, INFORMS_PERCENT, lower_bound
from decmcts.search.sequence.problem import OrderProblem, Seams

MOST_S = 10.0  # for the bound
MOST_EARLY_S = 3.0  # for the bound shown while searching
EARLY_SHARE = 0.05  # of the search time, for that one
EARLY_FROM_S = 3.0  # a shorter search ends before one could read it, and making it takes 0.2 s
SHARE = 0.5  # of the search time, at most, for the bound
WORDS_PER_S = 2e6  # words of 64 relations handled in a second, on a slow computer
MOST_BYTES = 2 * 2**30  # of relations
ROUNDING = 1e-9  # of a travel: what lies no further from it is the same


def certify(
    problem: OrderProblem,
    travel: float,
    *,
    time_limit_s: float,
    known: float | None = None,
    stopped: bool = False,
) -> dict[str, Any]:
    """Return what the metrics say of the bound, or of why there is none.

    Parameters
    ----------
    travel : float
        What the result's travels cost, mm or s as the problem has it.
    time_limit_s : float
        The time limit of the search; the bound takes a share of as much again.
    known : float | None
        What the search itself has proven; no lower bound is returned. If it is the
        travel, no more is done.
    stopped : bool
        Whoever waits for the result asked to end: nothing is proven any more.
    """
    allowed_s = min(MOST_S, SHARE * time_limit_s)
    name = f"bound_{problem.unit}"
    said: dict[str, Any] = {"travel_s": travel} if problem.unit == "s" else {}
    if known is not None and travel <= known * (1.0 + ROUNDING):
        return {**said, name: known, "gap_percent": 0.0, "bound_method": "exact"}
    reason = "stopped before one was proven" if stopped else _too_large(len(problem), allowed_s)
    if reason:
        return {**said, name: None, "gap_percent": None, "bound_skipped": reason}
    compile_bound(problem)
    found = lower_bound(problem, time_limit_s=allowed_s, upper_bound=travel)
    method: str = found.method
    if known is not None and known > found.bound:
        found, method = replace(found, bound=known), "search"
    said |= {name: found.bound, "gap_percent": found.gap_percent(travel)}
    return {**said, "bound_method": method}


def early_bound(problem: OrderProblem, *, time_limit_s: float) -> float | None:
    """Return a bound made in a twentieth of the search time, to show while searching."""
    allowed_s = min(MOST_EARLY_S, EARLY_SHARE * time_limit_s)
    if len(problem) <= EXACT_UP_TO or _too_large(len(problem), allowed_s):
        return None
    compile_bound(problem)
    return lower_bound(problem, time_limit_s=allowed_s).bound


def bound_line(metrics: Mapping[str, Any]) -> str | None:
    """Return one line on travel, bound and gap; None if no bound was asked for.

    A bound too far away to tell a good order from a quick one is not shown; it is in
    the metrics for programs.
    """
    what, travel, unit = "travel", metrics.get("extrusionless_travel_mm"), "mm"
    if "bound_s" in metrics:
        what, travel, unit = "travel time", metrics["travel_s"], "s"
    elif "bound_mm" not in metrics:
        return None
    bound, gap = metrics[f"bound_{unit}"], metrics["gap_percent"]
    if bound is None:
        return f"no bound on the {what}: {metrics['bound_skipped']}"
    if gap is None or gap > INFORMS_PERCENT:
        return f"{what} {travel:,.1f} {unit}; no useful bound was proven in the time it is given"
    above = f" → at most {gap:.1f} % above optimal"
    if gap <= 100.0 * ROUNDING:
        above = " → proven optimal"
    return f"{what} {travel:,.1f} {unit} ≥ bound {bound:,.1f} {unit}{above}"


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
        lower_bound(replace(row_of(n), pace=problem.pace), time_limit_s=0.0)


def row_of(n: int, *, loops: bool = False) -> OrderProblem:
    """Return `n` contours in a row to compile with: few are solved exactly, many not.

    With `loops` each may begin at either of its ends.
    """
    start = np.zeros((n, 3))
    start[:, 0] = np.arange(n)
    start[-1, 2] = 0.2
    graph = DependencyGraph.from_pairs(n, np.array([[0, n - 1]], np.int32))
    layer = (start[:, 2] > 0.0).astype(np.int32)
    end, either = start[::-1].copy(), np.ones(n, np.bool_)
    if not loops:
        return OrderProblem(start, end, either, layer, graph)
    ends = np.stack([start, end], axis=1).reshape(-1, 3)
    seams = Seams(2 * np.arange(n + 1), ends, ends.copy(), np.tile([0, 1], n).astype(np.int32))
    return OrderProblem(start, start.copy(), ~either, layer, graph, seams=seams)
