"""How far from optimal a result is at most, or why that is not known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.feasibility.graph import DependencyGraph
from decmcts.planning.one_head.certificate import Certificate, certify
from decmcts.search.sequence.problem import OrderProblem, Pace
from decmcts.search.sequence.stopping import Stopping


def row(n: int) -> OrderProblem:
    """Contours without extent, 1 mm apart, in source order."""
    start = np.zeros((n, 3))
    start[:, 0] = np.arange(n)
    graph = DependencyGraph.from_pairs(n, np.empty((0, 2), np.int32))
    return OrderProblem(start, start.copy(), np.zeros(n, np.bool_), np.zeros(n, np.int32), graph)


def test_gap_is_against_the_bound() -> None:
    """Ten contours 1 mm apart need 9 mm; 9.9 mm is a tenth more."""
    found = certify(row(10), 9.9, stopping=Stopping(1.0))
    assert (found.bound, found.unit) == (pytest.approx(9.0), "mm")
    assert found.gap_percent == pytest.approx(10.0)


def test_time_is_bounded_in_seconds() -> None:
    """At 1 mm/s and without end acceleration ten contours 1 mm apart need 9 s."""
    problem = replace(row(10), pace=Pace(1.0, 1e9, 1.0, 1e9))
    found = certify(problem, 9.9, stopping=Stopping(1.0))
    assert (found.bound, found.unit) == (pytest.approx(9.0), "s")


def test_metrics_say_all_of_it() -> None:
    """What plan.json keeps comes back whole."""
    for found in (
        certify(row(10), 9.9, stopping=Stopping(1.0)),
        certify(row(10), 9.9, stopping=Stopping(1.0, asked=lambda: True)),
        replace(certify(row(10), 9.9, stopping=Stopping(1.0)), unit="s"),
    ):
        assert Certificate.of({"extrusionless_travel_mm": 9.9, **found.metrics()}) == found
    assert Certificate.of({"extrusionless_travel_mm": 9.9}) is None


@pytest.mark.slow
@pytest.mark.parametrize(("n", "seconds"), [(3000, 0.01), (200_000, 100.0)])
def test_a_print_too_large_for_the_time_says_so(n: int, seconds: float) -> None:
    """Time and memory stay bounded; the user learns why there is no bound."""
    found = certify(row(n), 1.0, stopping=Stopping(seconds))
    assert found.bound is None
    assert str(n) in found.skipped


def test_what_the_search_has_proven_is_not_lost() -> None:
    """A bound of the search counts where the certificate's own is lower, or is not needed."""
    proven = certify(row(40), 39.0, stopping=Stopping(1.0), known=39.0)
    assert proven.gap_percent == 0.0
    found = certify(row(200), 400.0, stopping=Stopping(0.0), known=199.0)
    assert found.bound is None or found.bound >= 199.0
    found = certify(row(40), 78.0, stopping=Stopping(1e-3), known=39.0)
    assert found.bound == pytest.approx(39.0)
    assert found.gap_percent == pytest.approx(100.0)
