"""How far from optimal a result is at most: the certificate's part in planning one head.

The bound itself is made in `decmcts.search.certificate`; here is how long it may
take, for which prints it is tried, and how it is put.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from decmcts.feasibility.graph import DependencyGraph
from decmcts.search.certificate import EXACT_UP_TO, lower_bound
from decmcts.search.problem import OrderProblem

MOST_S = 10.0  # for the bound
MOST_EARLY_S = 3.0  # for the bound shown while searching
EARLY_SHARE = 0.05  # of the search time, for that one
SHARE = 0.5  # of the search time, at most, for the bound
WORDS_PER_S = 2e6  # words of 64 relations handled in a second, on a slow computer
MOST_BYTES = 2 * 2**30  # of relations


def certify(problem: OrderProblem, travel_mm: float, *, time_limit_s: float) -> dict[str, Any]:
    """Return what the metrics say of the bound, or of why there is none.

    Parameters
    ----------
    travel_mm : float
        Extrusionless travel of the result.
    time_limit_s : float
        The time limit of the search; the bound takes a share of as much again.
    """
    allowed_s = min(MOST_S, SHARE * time_limit_s)
    reason = _too_large(len(problem), allowed_s)
    if reason:
        return {"bound_mm": None, "gap_percent": None, "bound_skipped": reason}
    if len(problem) > EXACT_UP_TO:
        lower_bound(_row(EXACT_UP_TO + 1), time_limit_s=1.0)  # compiles, off the clock
    found = lower_bound(problem, time_limit_s=allowed_s, upper_bound_mm=travel_mm)
    return {
        "bound_mm": found.bound_mm,
        "gap_percent": found.gap_percent(travel_mm),
        "bound_method": found.method,
    }


def early_bound(problem: OrderProblem, *, time_limit_s: float) -> float | None:
    """Return a bound made in a twentieth of the search time, to show while searching."""
    allowed_s = min(MOST_EARLY_S, EARLY_SHARE * time_limit_s)
    if len(problem) <= EXACT_UP_TO or _too_large(len(problem), allowed_s):
        return None
    lower_bound(_row(EXACT_UP_TO + 1), time_limit_s=1.0)  # compiles, off the clock
    return lower_bound(problem, time_limit_s=allowed_s).bound_mm


def bound_line(metrics: Mapping[str, Any]) -> str | None:
    """Return one line on travel, bound and gap; None if no bound was asked for."""
    if "bound_mm" not in metrics:
        return None
    if metrics["bound_mm"] is None:
        return f"no bound on the travel: {metrics['bound_skipped']}"
    travel, bound = metrics["extrusionless_travel_mm"], metrics["bound_mm"]
    gap = metrics["gap_percent"]
    above = "" if gap is None else f" → at most {gap:.1f} % above optimal"
    return f"travel {travel:,.1f} mm ≥ bound {bound:,.1f} mm{above}"


def _too_large(n: int, allowed_s: float) -> str:
    """Return why a print is too large for the time, or nothing."""
    words = n * (n / 64)
    if 2 * 8 * words > MOST_BYTES:
        return f"{n} contours need more than {MOST_BYTES / 2**30:.0f} GiB of memory"
    if n > EXACT_UP_TO and words / WORDS_PER_S > allowed_s:
        return f"{n} contours need more than {allowed_s:.1f} s (half of --time-limit, at most 10 s)"
    return ""


def _row(n: int) -> OrderProblem:
    """Return a problem of `n` contours in a row, the smallest that takes the long way."""
    start = np.zeros((n, 3))
    start[:, 0] = np.arange(n)
    graph = DependencyGraph.from_pairs(n, np.array([[0, 2]], np.int32))
    return OrderProblem(start, start.copy(), np.ones(n, np.bool_), np.zeros(n, np.int32), graph)
