"""Heads that begin with a joint order: their trees vary it, their messages say how."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from decmcts.team.dec_mcts import planner as dec_mcts
from decmcts.team.dec_mcts.exchange import rearranges
from decmcts.team.dec_mcts.planner import DecMcts, Parameters
from decmcts.team.engine.plans import StatedOrder, encode
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.resolve import resolve
from decmcts.team.engine.values import EACH

FEW = Parameters(share=0.1, samples=4, renew=1, windows=0, tries=32)
HEADS = (0, 1)


@pytest.fixture(autouse=True)
def short_rounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rounds are short enough for tests."""
    monkeypatch.setattr(dec_mcts, "UNPOLISHED", 15_000)


@pytest.fixture(scope="module")
def problem(case: Callable[..., Any]) -> TeamProblem:
    """A print whose heads begin with what the second policy makes of it."""
    chosen = case(2, towers=8, reach=5.0)
    plain = build_team_problem(chosen.job, chosen.machine, chosen.graph)
    plans = dict.fromkeys(HEADS, encode(1, plain.n_macros))
    begun = StatedOrder.of(resolve(plain, plans, HEADS).toolpaths)
    return build_team_problem(chosen.job, chosen.machine, chosen.graph, start=begun)


def planned(problem: TeamProblem, rounds: int) -> list[DecMcts]:
    """Return two heads that planned in turn and told each other their plans."""
    team = [DecMcts(problem, r, seed=2, parameters=FEW) for r in HEADS]
    for _ in range(rounds):
        for agent in team:
            agent.iterate(HEADS)
            team[1 - agent.head].take(agent.head, agent.distribution)
    return team


@pytest.mark.slow
def test_trees_vary_an_order_that_no_policy_comes_near(
    problem: TeamProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Few policies are tried; X̂, q and the best are of its macro-actions; all of it repeats."""
    monkeypatch.setattr(dec_mcts, "AT_ONCE", 8 * dec_mcts.ENOUGH * len(problem.macro))
    monkeypatch.setattr(DecMcts, "_policies_s", lambda *_: np.inf)
    team = planned(problem, 5)
    begun = team[0]._start_s(HEADS)
    for agent in team:
        assert len(agent._trials[HEADS].makespans) == dec_mcts.ENOUGH < 16
        told = agent.distribution
        assert len(told.sequences) > 2 and told.entropy < 1.0
        assert all(rearranges(problem, plan) for plan in told.sequences)
        assert all(rearranges(problem, plan) for plan in agent._tree.best_plans(1000))
        best = agent.best(HEADS)
        assert best.makespan_s == resolve(problem, best.plans, HEADS).makespan_s <= begun
    assert min(agent.best(HEADS).makespan_s for agent in team) < begun
    again = planned(problem, 5)
    for ours, theirs in zip(team, again, strict=True):
        assert (
            ours.distribution.probabilities.tolist() == theirs.distribution.probabilities.tolist()
        )
        assert ours.best(HEADS).makespan_s == theirs.best(HEADS).makespan_s


@pytest.mark.slow
def test_trees_vary_policies_that_end_sooner(
    problem: TeamProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Then the order to begin with is one start among others."""
    monkeypatch.setattr(DecMcts, "_policies_s", lambda *_: 0.0)
    for agent in planned(problem, 3):
        assert len(agent._trials[HEADS].makespans) == 16
        assert not any(rearranges(problem, plan) for plan in agent._tree.best_plans(1000))
        assert agent.best(HEADS).makespan_s <= agent._start_s(HEADS)


def test_what_is_told_of_it_means_nothing_to_fewer_heads(problem: TeamProblem) -> None:
    """The order is all heads'; a head that is left plans as if it had none."""
    agent = DecMcts(problem, 0, seed=2, parameters=FEW)
    begun = agent._as_begun()
    alone = agent._values.makespan({1: begun[:0]}, (1,))
    assert resolve(problem, {1: begun}, (1,)).makespan_s == alone
    plans = dict.fromkeys(HEADS, begun)
    agent._values.utility(0, plans, HEADS)
    placed = agent._values.placed
    agent._values.utility(0, {**plans, 1: np.append(begun, [0, 1, 0]).astype(np.int32)}, HEADS)
    assert agent._values.placed - placed == len(problem.macro) + EACH
