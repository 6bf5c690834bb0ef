"""The team's planner behind the agents' face: told plans, the serial way out, the digest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from agents.messages.kinds import Distribution, MessageError
from agents.planners.pack import Pack
from agents.planners.serial import joint_order, serial_plans
from agents.planners.team_planner import DecMctsPlanner
from decmcts.errors import InputError
from decmcts.feasibility.build import build_graph
from decmcts.print.job import ProcessSettings
from decmcts.print.toolpath import Toolpath
from decmcts.team.dec_mcts.parameters import Parameters
from decmcts.team.engine.plans import (
    MOST_SHIFT,
    POLICIES,
    Changes,
    StatedOrder,
    encode,
    encode_changes,
    encode_serial,
)
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.resolve import resolve
from decmcts.team.schedule.joint_plan import schedule
from tests.team.conftest import make_job, make_machine

LIVE = (0, 1)


@pytest.fixture(scope="module")
def problem() -> TeamProblem:
    machine, job = make_machine(), make_job(2, towers=8, reach=5.0)
    graph = build_graph(job.contours, machine.heads, clearance_mm=machine.clearance_mm)
    return build_team_problem(job, machine, graph)


@pytest.fixture
def planner(problem: TeamProblem) -> DecMctsPlanner:
    return DecMctsPlanner(problem, 0, seed=1)


def test_the_serial_order_is_the_source_s_and_can_be_executed(
    problem: TeamProblem, planner: DecMctsPlanner
) -> None:
    """The way out must be a plan that prints, whatever else fails."""
    found = planner.serial(LIVE)
    order = joint_order(problem, found.plans, LIVE)
    assert order.digest == found.digest
    rows = np.concatenate([np.stack([t.turn, t.order], axis=1) for t in order.toolpaths])
    rows = rows[np.argsort(rows[:, 0])]
    assert rows[:, 1].tolist() == list(range(len(problem.macro)))
    plan = schedule(problem.job, problem.machine, problem.graph, list(order.toolpaths))
    assert plan.makespan_s > 0.0


def test_the_digest_of_a_serial_order_is_of_whole_numbers_only(
    problem: TeamProblem, planner: DecMctsPlanner
) -> None:
    """Hosts whose arithmetic differs must agree on it: times may not count."""
    visits = problem.visits._replace(seconds=problem.visits.seconds * 1.0000001)
    other = DecMctsPlanner(replace(problem, visits=visits), 1, seed=7)
    mine, theirs = planner.serial(LIVE), other.serial(LIVE)
    assert mine.digest == theirs.digest
    assert mine.makespan_s != theirs.makespan_s
    assert other.resolve(mine.plans, LIVE).digest == mine.digest


def test_another_order_has_another_digest(problem: TeamProblem, planner: DecMctsPlanner) -> None:
    """A digest that says nothing of the order would let two heads print different ones."""
    n = len(problem.macro)
    order = Toolpath.of(np.arange(n, dtype=np.int32), np.arange(n) % 2 == 1)
    plans = {0: encode_serial(order, problem.n_macros)}
    assert planner.resolve(plans, LIVE).digest != planner.serial(LIVE).digest


def test_an_order_that_breaks_the_precedence_is_not_accepted(problem: TeamProblem) -> None:
    """Each host checks the order by its own precedence."""
    n = len(problem.macro)
    order = Toolpath.of(np.arange(n, dtype=np.int32)[::-1].copy(), np.zeros(n, np.bool_))
    with pytest.raises(InputError, match="contradicts the precedence"):
        joint_order(problem, {0: encode_serial(order, problem.n_macros)}, LIVE)


def test_a_better_plan_of_a_peer_is_kept_a_worse_one_is_not(problem: TeamProblem) -> None:
    """What one head finds, all build on."""
    finder, other = DecMctsPlanner(problem, 0, seed=1), DecMctsPlanner(problem, 1, seed=2)
    first = other.best_joint(LIVE).makespan_s
    for _ in range(3):
        finder.iterate(LIVE)
    found = finder.best_joint(LIVE)
    assert found.makespan_s < first
    other.offer(found.plans, LIVE)
    assert other.best_joint(LIVE).makespan_s == found.makespan_s
    other.offer(serial_plans(problem, LIVE), LIVE)
    assert other.best_joint(LIVE).makespan_s == found.makespan_s


def test_all_that_is_told_is_understood(problem: TeamProblem) -> None:
    """Plans with shifts either way among it."""
    teller, listener = (DecMctsPlanner(problem, head, seed=5) for head in LIVE)
    shifted = False
    for _ in range(12):
        teller.iterate(LIVE)
        told, joint = teller.distribution(), teller.best_joint(LIVE)
        shifted = shifted or any((plan < 0).any() for plan in told.sequences)
        listener.take(0, told)
        listener.offer(joint.plans, LIVE)
        listener.resolve(joint.plans, LIVE)
    assert shifted


def _refused(n_macros: int) -> list[tuple[int, ...]]:
    shifted, policy = (0,) * n_macros, n_macros
    return [
        (-7,),
        (n_macros - 1,),
        (n_macros + len(POLICIES),),
        (policy, *shifted, 0),
        (policy, *shifted[1:], MOST_SHIFT + 1),
        (policy, *shifted[1:], -(2**31)),
    ]


def test_a_told_serial_order_that_cannot_be_stops_nobody(
    planner: DecMctsPlanner, problem: TeamProblem
) -> None:
    """It would be kept as the best, and refused when it is proposed."""
    n = len(problem.macro)
    order = Toolpath.of(np.arange(n, dtype=np.int32)[::-1].copy(), np.zeros(n, np.bool_))
    plan = encode_serial(order, problem.n_macros)
    with pytest.raises(MessageError, match="contradicts the precedence"):
        planner.offer({1: plan, 0: encode(0, problem.n_macros)}, LIVE)
    with pytest.raises(MessageError, match="contradicts the precedence"):
        planner.take(1, Distribution((plan,), np.ones(1)))
    planner.best(LIVE)


@pytest.mark.parametrize("row", range(len(_refused(3))))
def test_a_told_plan_that_means_nothing_is_refused(
    planner: DecMctsPlanner, problem: TeamProblem, row: int
) -> None:
    """It comes from outside."""
    plan = np.int32(_refused(problem.n_macros)[row])
    with pytest.raises(MessageError, match="means nothing"):
        planner.offer({1: plan}, LIVE)
    with pytest.raises(MessageError, match="means nothing"):
        planner.take(1, Distribution((plan,), np.ones(1)))


def test_another_process_is_another_problem(problem: TeamProblem) -> None:
    """What plans resolve to depends on it, so such hosts must not plan together."""
    settings = ProcessSettings(travel_feed=101.0, retract_mm=1.0)
    other = replace(problem, job=replace(problem.job, settings=settings))
    digests = {DecMctsPlanner(p, 0, seed=1).problem for p in (problem, other)}
    assert len(digests) == 2


@pytest.mark.slow
def test_a_pack_s_parameters_are_the_search_s(problem: TeamProblem) -> None:
    """What a launch sets must reach each head; the rest stays as the print asks for."""
    pack = Pack(problem.job, problem.machine, problem.graph, {"share": 0.5, "alpha": 0.5})
    usual = Parameters.for_contours(len(problem.macro))
    found = DecMctsPlanner.of_pack(pack, 0, seed=1)._search.parameters
    assert found == replace(usual, share=0.5, alpha=0.5)
    with pytest.raises(InputError, match="alpha"):
        DecMctsPlanner.of_pack(replace(pack, parameters={"alpha": 2}), 0, seed=1)


@pytest.mark.slow
def test_agents_that_begin_with_an_order_tell_what_they_change(problem: TeamProblem) -> None:
    """A peer's plan resolves here as there; without the order it is another problem."""
    order = StatedOrder.of(resolve(problem, {}, LIVE).toolpaths)
    pack = Pack(problem.job, problem.machine, problem.graph, start=order)
    begun = build_team_problem(pack.job, pack.machine, pack.graph, start=order)
    start = begun.start
    assert start is not None
    own = [np.flatnonzero(start.head == r) for r in LIVE]
    plans = {
        r: encode_changes(
            Changes(rows, np.full(len(rows), 5 - 8 * r), start.head[rows]), begun.n_macros
        )
        for r, rows in enumerate(own)
    }
    teller, listener = DecMctsPlanner(begun, 0, seed=1), DecMctsPlanner(begun, 1, seed=1)
    assert teller.resolve(plans, LIVE).digest == listener.resolve(plans, LIVE).digest
    assert teller.resolve(plans, LIVE).digest != teller.resolve({}, LIVE).digest
    listener.take(0, Distribution((plans[0],), np.ones(1)))
    assert sum(map(len, plans.values())) * 100 <= 2 * teller.most_symbols
    assert DecMctsPlanner(problem, 0, seed=1).problem != teller.problem
    assert DecMctsPlanner.of_pack(pack, 0, seed=1).problem == teller.problem
