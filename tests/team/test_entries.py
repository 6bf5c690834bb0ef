"""Entries chosen for given orders: least travel, the orders kept, the judge content."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.print.plan import OrderRules, PlanDocument
from decmcts.print.toolpath import Toolpath, endpoints
from decmcts.search.problem import OrderProblem
from decmcts.team.entries import entered_anew
from decmcts.team.schedule import schedule
from sim.verify import verify_plan
from tests.team.test_schedule import random_split

SEEDS = range(6)


def travel_mm(case: Any, paths: list[Toolpath]) -> float:
    """What all heads travel between their contours."""
    total = 0.0
    for path in paths:
        first, last = endpoints(case.job.contours, path)
        total += float(np.linalg.norm(first[1:] - last[:-1], axis=1).sum())
    return total


@pytest.mark.parametrize("freedom", ["reversible", "seam"])
@pytest.mark.parametrize("seed", SEEDS)
def test_each_head_travels_less_in_the_same_order(
    case: Callable[..., Any], seed: int, freedom: Any
) -> None:
    """No random change of one entry or direction is better, and the judge finds nothing new."""
    chosen = case(seed)
    paths = random_split(chosen, seed)
    problem = OrderProblem.from_job(chosen.job, chosen.graph, freedom)
    found = entered_anew(problem, paths)
    assert [path.order.tolist() for path in found] == [path.order.tolist() for path in paths]
    assert travel_mm(chosen, found) < travel_mm(chosen, paths)
    assert freedom == "seam" or not any(path.entry.any() for path in found)
    plan = schedule(chosen.job, chosen.machine, chosen.graph, found)
    rules = OrderRules("free", False, None, freedom)
    document = PlanDocument(
        "", chosen.machine, chosen.job.contours, chosen.graph.pairs(), plan, {}, rules=rules
    )
    assert not verify_plan(document, source=chosen.job, trials=2).faults


def test_a_contour_left_out_is_refused(case: Callable[..., Any]) -> None:
    """What is not printed cannot be entered."""
    chosen = case(0)
    paths = random_split(chosen, 0)
    short = Toolpath.of(paths[0].order[1:], paths[0].reversed[1:])
    problem = OrderProblem.from_job(chosen.job, chosen.graph, "seam")
    with pytest.raises(InputError, match="every contour once"):
        entered_anew(problem, [short, paths[1]])
