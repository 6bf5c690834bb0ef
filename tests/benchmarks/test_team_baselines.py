"""The planners others would use: whatever they find is an order the engine and the judge accept."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

import team_baselines

from decmcts.search.sequence.stopping import Stopping
from decmcts.team.engine.order import units_of
from decmcts.team.engine.plans import StatedOrder, encode_stated
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import resolve
from decmcts.team.incumbent import Budget
from decmcts.team.schedule.joint_plan import schedule
from tests.makers.random_teams import judged, problem_of

BASELINES = {"annealing": team_baselines.annealing, "policies": team_baselines.policies}


def few(orders: int = 6) -> Budget:
    """A budget that counts joint orders alone."""
    return Budget(Stopping(iterations=orders))


@pytest.fixture(scope="module")
def problem() -> TeamProblem:
    """A random print on a random machine."""
    return problem_of(1)


@pytest.mark.long
@pytest.mark.parametrize("name", BASELINES)
@pytest.mark.parametrize("seed", [1, 4])
def test_the_judge_accepts_it_on_random_machines(name, seed):
    """Three heads and more, reaches and tools of their own, no rail: no baseline is for two."""
    problem = problem_of(seed)
    found = BASELINES[name](problem, few(), seed=0)
    assert sum(len(path) for path in found.toolpaths) == len(problem.macro)
    plan = schedule(problem.job, problem.machine, problem.graph, found.toolpaths)
    assert judged(problem, plan).ok


@pytest.mark.long
@pytest.mark.parametrize("name", BASELINES)
def test_equal_seeds_give_equal_orders(name, problem):
    """Else no table could be made again."""
    one, two = (BASELINES[name](problem, few(12), seed=3) for _ in range(2))
    assert one.makespan_s == two.makespan_s
    for a, b in zip(one.toolpaths, two.toolpaths, strict=True):
        assert np.array_equal(a.order, b.order)
        assert np.array_equal(a.reversed, b.reversed)


@pytest.mark.parametrize("name", BASELINES)
def test_makespans_are_the_engine_s(name, problem):
    """All are compared by the function the agents share."""
    found = BASELINES[name](problem, few(4), seed=0)
    units = units_of(problem.visits, problem.fleet, problem.machine, found.toolpaths)
    assert float(units.end.max()) == pytest.approx(found.makespan_s, rel=1e-12)
    stated = StatedOrder.of(found.toolpaths)
    plan = encode_stated(stated, len(found.toolpaths), problem.n_macros)
    assert resolve(problem, {0: plan}, range(len(found.toolpaths))).makespan_s == pytest.approx(
        found.makespan_s
    )


def test_annealing_moves_keep_the_precedence(problem):
    """The engine refuses an order in which something is printed before what supports it."""
    rng = np.random.default_rng(2)
    units = team_baselines.dispatched(
        problem, team_baselines.nth_weights(0, len(problem.machine.heads), rng)
    )
    order, moves = team_baselines.order_of(units), team_baselines.RandomMoves(problem, rng)
    before, after = problem.graph.pairs().T
    for _ in range(300):
        order = moves.changed(order)
        place = np.argsort(order.contour)
        assert np.array_equal(np.sort(order.contour), np.arange(len(place)))
        assert (place[before] < place[after]).all()
        assert problem.space.eligible[np.arange(len(place)), order.head].all()
