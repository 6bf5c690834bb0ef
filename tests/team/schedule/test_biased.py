"""Loops with biased entries: a head releases first what others want."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from decmcts.feasibility.rules import order_rules
from decmcts.print.lags_kernels import no_lags
from decmcts.print.seam import seam_entries
from decmcts.team.engine.plans import TUNED, encode
from decmcts.team.engine.problem import build_team_problem
from decmcts.team.engine.resolve import resolve
from decmcts.team.schedule.entries import OrderChoices, agreed_job, biased_entries, entries_of

LEFT = [(50, 10), (50, 50), (30, 50), (10, 50), (10, 10), (30, 10), (50, 10)]


def releasing(case: Any) -> Any:
    """Return the case on a machine whose heads release space point by point."""
    return replace(case, machine=replace(case.machine, release="point"))


def biased(case: Any, orders: OrderChoices, entry: np.ndarray) -> np.ndarray:
    """Where loops are entered while heads plan."""
    entries, none = entries_of(case.job, orders), no_lags(len(entry))
    return biased_entries(case.job, case.machine, case.graph, orders, entry, entries, none)


def makespan(case: Any, entry: np.ndarray) -> float:
    """What two heads take by the best of the first policies, with loops entered there."""
    job = agreed_job(case.job, OrderChoices("seam"), entry)
    problem = build_team_problem(job, case.machine, case.graph)
    plans = [encode(policy, problem.n_macros) for policy in range(TUNED)]
    return min(resolve(problem, {0: plan, 1: plan}, (0, 1)).makespan_s for plan in plans)


def test_loops_that_face_each_other_are_biased_apart(case_of: Callable[..., Any]) -> None:
    """As sliced they begin and end where the other head prints, so one must wait for the other."""
    sides = [[(x, y, 0.5) for x, y in LEFT], [(110 - x, y, 0.5) for x, y in LEFT]]
    case = releasing(case_of(*sides))
    sliced = np.zeros(2, np.int32)
    found = biased(case, OrderChoices("seam"), sliced)
    at = case.job.contours.points[case.job.contours.offsets[:-1] + found, 0]
    assert at[0] == 10.0 or at[1] == 100.0
    assert makespan(case, found) < 0.9 * makespan(case, sliced)


@pytest.mark.parametrize("seed", range(4))
def test_they_are_biased_only_where_that_is_sooner(case: Callable[..., Any], seed: int) -> None:
    """Each at a vertex where it may begin, and never later than where they were entered."""
    made = releasing(case(seed, reach=11.0))
    made = replace(made, graph=order_rules(made.job, made.machine, free_seams=True))
    entries = seam_entries(made.job.contours)
    entry = entries.vertices[entries.offsets[1:] - 1]
    found = biased(made, OrderChoices("seam"), entry)
    for c, vertex in enumerate(found):
        assert vertex in entries.vertices[entries.offsets[c] : entries.offsets[c + 1]]
    assert makespan(made, found) <= makespan(made, entry)


@pytest.mark.parametrize(
    ("orders", "release"),
    [
        (OrderChoices(), "point"),
        (OrderChoices("seam", "rear"), "point"),
        (OrderChoices("seam"), "action"),
    ],
)
def test_else_loops_stay(case: Callable[..., Any], orders: OrderChoices, release: Any) -> None:
    """Where they may not move, a policy names their seams, or space is released at the end."""
    made = case(1, reach=11.0)
    made = replace(made, machine=replace(made.machine, release=release))
    entry = np.zeros(len(made.job.contours), np.int32)
    assert biased(made, orders, entry) is entry
