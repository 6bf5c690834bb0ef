"""What must cool does, on whichever head, for every timing the plan's order allows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from decmcts.print.lags_kernels import Lags, no_lags
from decmcts.print.plan import ActionKind, JointPlan, PlanDocument
from decmcts.print.toolpath import Toolpath
from decmcts.team.engine.plans import StatedOrder, encode_stated
from decmcts.team.engine.problem import build_team_problem
from decmcts.team.engine.resolve import resolve
from decmcts.team.schedule.cooling import find_lags, source_times
from decmcts.team.schedule.joint_plan import schedule
from decmcts.team.schedule.waits import LEAST_WAIT_S
from sim.faults import FaultKind
from sim.verify import verify_plan
from tests.team.schedule.test_joint_plan import random_split

RULE_S = 6.0
SEEDS = range(8)


def lags_of(case: Any, rule_s: float = RULE_S) -> Lags:
    """The rule, or the source's lag if less."""
    times = source_times(case.job, case.machine, case.graph)
    return find_lags(case.job.contours, [times], rule_s)[0]


def faults(case: Any, plan: JointPlan, rule_s: float = RULE_S) -> set[FaultKind]:
    """What the judge finds."""
    contours, pairs = case.job.contours, case.graph.pairs()
    document = PlanDocument("", case.machine, contours, pairs, plan, {}, rule_s)
    return {fault.kind for fault in verify_plan(document, trials=2).faults}


@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_is_printed_over_too_soon(case: Callable[..., Any], seed: int) -> None:
    """Any split of the towers between two heads keeps the rule once heads rest."""
    chosen = case(seed)
    paths = random_split(chosen, seed)
    given = chosen.job, chosen.machine, chosen.graph, paths
    warm = faults(chosen, schedule(*given))
    assert FaultKind.COOLING in warm
    # a random order may break what the judge asks of lines that touch, cooled or not
    assert faults(chosen, schedule(*given, lags=lags_of(chosen))) == warm - {FaultKind.COOLING}


def test_without_lags_the_plan_is_the_same(case: Callable[..., Any]) -> None:
    """Nothing to cool: no rest, no other order."""
    chosen = case(1)
    given = chosen.job, chosen.machine, chosen.graph, random_split(chosen, 1)
    plain, cooled = schedule(*given), schedule(*given, lags=no_lags(len(chosen.job.contours)))
    assert plain.makespan_s == cooled.makespan_s
    assert all((a.kind == b.kind).all() for a, b in zip(plain.heads, cooled.heads, strict=True))


def test_a_head_rests_no_longer_than_it_must(case_of: Callable[..., Any]) -> None:
    """One line on another, by another head that has other work in between."""
    low, high = [(60.0, 30.0, 0.5), (70.0, 30.0, 0.5)], [(60.0, 30.0, 1.0), (70.0, 30.0, 1.0)]
    far = [(110.0, 10.0, 0.5), (110.0, 50.0, 0.5)]
    chosen = case_of(low, high, far)
    n = np.zeros(3, np.bool_)
    lags = Lags(np.array([0, 0, 1, 1]), np.array([0], np.int32), np.array([8.0]))
    paths = [
        Toolpath.of(np.array([0], np.int32), n[:1]),
        Toolpath.of(np.array([2, 1], np.int32), n[:2]),
    ]
    plan = schedule(chosen.job, chosen.machine, chosen.graph, paths, lags=lags)
    right = plan.heads[1]
    ended = float(plan.heads[0].end_s[plan.heads[0].contour == 0][0])
    begun = float(right.begin_s[right.contour == 1][0])
    work = float((right.end_s - right.begin_s)[right.contour == 2][0])
    rested = float((right.end_s - right.begin_s)[right.kind == ActionKind.WAIT].sum())
    assert begun >= ended + 8.0 - LEAST_WAIT_S
    assert begun <= ended + 8.0 + work + LEAST_WAIT_S
    assert rested < 8.0


@pytest.mark.parametrize("seed", SEEDS)
def test_the_engine_plans_with_what_must_cool(case: Callable[..., Any], seed: int) -> None:
    """The same order takes longer with lags than without, and the exact plan is not far off."""
    chosen = case(seed, towers=3)
    warm = build_team_problem(chosen.job, chosen.machine, chosen.graph)
    cool = build_team_problem(chosen.job, chosen.machine, chosen.graph, lags_of(chosen, 30.0))
    assert warm.digest != cool.digest
    estimate = resolve(cool, {}, [0, 1])
    paths = list(estimate.toolpaths)
    plan = schedule(chosen.job, chosen.machine, chosen.graph, paths, lags=cool.visits.lags)
    order = StatedOrder.of(resolve(warm, {}, [0, 1]).toolpaths)
    same = {0: encode_stated(order, 2, warm.n_macros)}
    assert resolve(cool, same, [0, 1]).makespan_s > resolve(warm, same, [0, 1]).makespan_s
    assert plan.makespan_s < 1.5 * estimate.makespan_s
    assert FaultKind.COOLING not in faults(chosen, plan, 30.0)
