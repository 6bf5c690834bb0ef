"""Compiling takes seconds: none of it may come out of the heads' time."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.team.dec_mcts.parameters import Parameters
from decmcts.team.dec_mcts.planner import DecMcts
from decmcts.team.dec_mcts.warm_up import HEADS, compile_rounds, smallest_problem
from decmcts.team.engine.plans import StatedOrder, encode_stated
from decmcts.team.engine.resolve import resolve
from tests.late_kernels import late_kernels

LOADED = """
from decmcts.feasibility.build import build_graph
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.dec_mcts.rounds import plan_in_turn
from decmcts.team.engine.plans import StatedOrder
from decmcts.team.engine.problem import build_team_problem
from decmcts.team.engine.resolve import resolve
from decmcts.team.dec_mcts.warm_up import compile_rounds
from tests.team.conftest import make_job, make_machine
"""
AHEAD = """
machine, job = make_machine(), make_job(2, towers=8, reach=5.0)
graph = build_graph(job.contours, machine.heads, clearance_mm=machine.clearance_mm)
problem = build_team_problem(job, machine, graph)
begun = StatedOrder.of(resolve(problem, {}, (0, 1)).toolpaths)
begun = build_team_problem(job, machine, graph, start=begun)
if case[0] == "ahead":
    compile_rounds()
"""
SEARCH = """
for each in (problem, begun):
    plan_in_turn(each, stopping=Stopping(iterations=6), seed=0)
"""


@pytest.mark.long
def test_rounds_find_every_kernel_compiled() -> None:
    """Policies, tree, distribution, polishing and what is told."""
    ahead, late = late_kernels(LOADED, AHEAD, SEARCH, [["ahead"], ["late"]])
    assert ahead == [] and {"polish", "not_before"} <= set(late)


@pytest.mark.slow
def test_a_told_order_that_cannot_be_is_not_polished() -> None:
    """It comes from outside, and polishing believes what it is given."""
    problem = smallest_problem()
    agent = compile_rounds(problem)[0]
    good = StatedOrder.of(resolve(problem, {}, HEADS).toolpaths)
    bad = StatedOrder(good.order[::-1].copy(), good.reversed, good.head)
    agent.take_joint({1: encode_stated(bad, 2, problem.n_macros)}, HEADS)
    agent.iterate(HEADS)
    best = agent.best(HEADS)
    assert resolve(problem, best.plans, HEADS).makespan_s == best.makespan_s
    assert agent._polishing is not None
    turn = np.empty(len(good.order), np.int64)
    turn[agent._polishing.polish.best.order] = np.arange(len(turn))
    before, after = problem.graph.pairs().T
    assert (turn[before] < turn[after]).all()


@pytest.mark.slow
@pytest.mark.parametrize("samples", [1, 2, 3, 5])
def test_every_other_joint_plan_is_of_what_was_told(
    samples: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However many samples there are to an update."""
    problem, combined, jointly = smallest_problem(), [], []
    agent = DecMcts(problem, 0, seed=0, parameters=Parameters(samples=samples, tries=2, windows=1))
    usual, tried = agent._combination, agent._combine
    monkeypatch.setattr(agent, "_combination", lambda team: combined.append(1) or usual(team))
    monkeypatch.setattr(agent, "_combine", lambda team: jointly.append(1) or tried(team))
    for _ in range(8):
        agent.iterate(HEADS)
    assert len(jointly) > 4
    assert abs(2 * len(combined) - len(jointly)) <= 1
