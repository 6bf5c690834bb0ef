"""Heads that are late meet where a plan is run by the clock, and never where it is ours."""

from __future__ import annotations

import pytest

from decmcts.print.plan import PlanDocument
from tests.makers.late_heads import TROUBLES, Rehearsal, random_trouble
from tests.makers.random_teams import RULES, outcome, problem_of


@pytest.fixture(scope="module")
def rehearsal() -> Rehearsal:
    """A joint plan of two heads on a rail."""
    problem = problem_of(5)
    plan = outcome(problem, {}).plan
    assert plan is not None
    pairs = problem.graph.pairs()
    contours = problem.job.contours
    return Rehearsal(PlanDocument("", problem.machine, contours, pairs, plan, {}, rules=RULES))


@pytest.mark.slow
def test_at_planned_times_both_do_the_same(rehearsal: Rehearsal) -> None:
    """Else what the baseline suffers could come from the way it is run."""
    calm = random_trouble("none", rehearsal.legs, 0)
    ours, clock = (rehearsal.run(calm, by_the_clock=c) for c in (False, True))
    assert ours == clock
    assert (ours.contacts, ours.too_near, ours.rail_breaks, ours.too_early) == (0, 0, 0, 0)


@pytest.mark.slow
@pytest.mark.parametrize("name", TROUBLES)
def test_ours_never_meets_whatever_the_trouble(rehearsal: Rehearsal, name: str) -> None:
    """No timing error can make heads collide: what the partial order is for."""
    for seed in range(5):
        run = rehearsal.run(random_trouble(name, rehearsal.legs, seed), by_the_clock=False)
        assert (run.contacts, run.too_near, run.rail_breaks, run.too_early) == (0, 0, 0, 0)


@pytest.mark.slow
def test_the_same_plan_by_the_clock_collides(rehearsal: Rehearsal) -> None:
    """An experiment in which nothing can collide would show nothing."""
    runs = [
        rehearsal.run(random_trouble("both", rehearsal.legs, seed), by_the_clock=True)
        for seed in range(5)
    ]
    assert sum(run.contacts for run in runs) > 5


def test_equal_seeds_give_equal_trouble(rehearsal: Rehearsal) -> None:
    """Rows of the table can be made again."""
    a, b = (random_trouble("both", rehearsal.legs, 4) for _ in range(2))
    assert all((x == y).all() for x, y in zip(a.late_s, b.late_s, strict=True))
    assert all((x == y).all() for x, y in zip(a.factor, b.factor, strict=True))
