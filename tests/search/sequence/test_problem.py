"""Which contours a planner may be reversed, and what a problem refuses."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.search.sequence.problem import OrderProblem


def three_contours() -> PrintJob:
    """An open contour that may be reversed, an open one that may not, and a closed one."""
    points = np.array(
        [[0, 0, 0.2], [1, 0, 0.2], [3, 0, 0.2], [4, 0, 0.2], [5, 5, 0.2], [6, 5, 0.2], [5, 5, 0.2]],
        np.float64,
    )
    n, k = 3, len(points)
    return PrintJob(
        "three",
        Contours(
            points,
            np.array([0, 2, 4, 7]),
            np.zeros(k),
            np.zeros(k),
            np.full(n, 0.4),
            np.full(n, 0.2),
            np.zeros(n, np.int8),
            np.array([False, False, True]),
            np.zeros(n, np.int32),
            np.zeros(n, np.int16),
            np.array([True, False, True]),
            np.zeros(n, np.int32),
            np.zeros(n, np.int32),
        ),
    )


NO_EDGES = np.empty((0, 2), np.int32)


def test_only_open_contours_the_reader_allows_may_be_reversed() -> None:
    """Reversing a contour with variable flow would spoil the bead."""
    job, graph = three_contours(), DependencyGraph.from_pairs(3, NO_EDGES)
    problem = OrderProblem.from_job(job, graph, "reversible")
    assert problem.reversible.tolist() == [True, False, False]
    assert problem.end.tolist() == job.contours.end.tolist()
    assert not OrderProblem.from_job(job, graph, "fixed").reversible.any()


def test_foreign_graphs_and_unknown_freedoms_are_refused() -> None:
    """A graph of another print would allow anything."""
    job = three_contours()
    with pytest.raises(ValueError, match="the graph has 2 contours, the job 3"):
        OrderProblem.from_job(job, DependencyGraph.from_pairs(2, NO_EDGES), "fixed")
    with pytest.raises(ValueError, match="freedom is 'any'"):
        OrderProblem.from_job(job, DependencyGraph.from_pairs(3, NO_EDGES), "any")  # type: ignore[arg-type]  # bad on purpose


def test_endpoints_must_be_finite() -> None:
    """A NaN would make every comparison of costs false."""
    start = np.zeros((2, 3))
    start[1, 0] = np.nan
    graph = DependencyGraph.from_pairs(2, NO_EDGES)
    with pytest.raises(ValueError, match="not finite"):
        OrderProblem(start, np.zeros((2, 3)), np.ones(2, bool), np.zeros(2, np.int32), graph)
