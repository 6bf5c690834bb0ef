"""One head's planner: deterministic, never worse than where it began, alive alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.print.toolpath import Toolpath
from decmcts.team import dec_mcts
from decmcts.team.alone import one_head_toolpaths
from decmcts.team.dec_mcts import DecMcts, Parameters
from decmcts.team.plan import plan_team
from decmcts.team.plans import decode
from decmcts.team.problem import TeamProblem, build_team_problem
from decmcts.team.resolve import resolve
from decmcts.team.schedule import schedule

FEW = Parameters(updates=2, samples=4, renew=1)


@pytest.fixture(scope="module")
def problem(case: Callable[..., Any]) -> TeamProblem:
    chosen = case(2, towers=8, reach=5.0)
    return build_team_problem(chosen.job, chosen.machine, chosen.graph)


def _rounds(problem: TeamProblem, seed: int) -> tuple[list[bytes], float]:
    """Two agents in turn, and all they told."""
    team = [DecMcts(problem, r, seed=seed, parameters=FEW) for r in range(2)]
    told: list[bytes] = []
    for _ in range(3):
        for agent in team:
            agent.iterate([0, 1])
            told += [s.tobytes() for s in agent.distribution.sequences]
            told.append(agent.distribution.probabilities.tobytes())
            team[1 - agent.head].take(agent.head, agent.distribution)
    return told, min(agent.best([0, 1]).makespan_s for agent in team)


@pytest.mark.slow
def test_equal_seeds_and_messages_give_equal_plans(problem: TeamProblem) -> None:
    """Without this no failure of the team could ever be replayed."""
    assert _rounds(problem, 5) == _rounds(problem, 5)
    assert _rounds(problem, 5)[0] != _rounds(problem, 6)[0]


@pytest.mark.slow
def test_best_is_what_its_plans_resolve_to(problem: TeamProblem) -> None:
    """A proposal must come true on every other agent."""
    agent = DecMcts(problem, 0, seed=1, parameters=FEW)
    before = agent.best([0, 1])
    agent.iterate([0, 1])
    after = agent.best([0, 1])
    assert after.makespan_s <= before.makespan_s
    assert resolve(problem, after.plans, [0, 1]).makespan_s == after.makespan_s


@pytest.mark.slow
def test_utility_is_the_gain_over_doing_nothing(problem: TeamProblem) -> None:
    """fʳ = g(xʳ, x⁻ʳ) - g(∅ʳ, x⁻ʳ): here the other head could print it all, but slower."""
    agent = DecMcts(problem, 0, seed=1, parameters=FEW)
    mine, other = agent._likeliest(0), agent._likeliest(1)
    serial = 2 * float(problem.visits.seconds.sum())
    both = resolve(problem, {0: mine, 1: other}, [0, 1]).makespan_s
    alone = resolve(problem, {1: other}, [1]).makespan_s
    want = max(0.0, 1 - both / serial) - max(0.0, 1 - alone / serial)
    assert agent._utility(mine, {1: other}, (0, 1)) == pytest.approx(want)


@pytest.mark.slow
def test_alone_it_prints_everything(problem: TeamProblem) -> None:
    """When the peers die the survivor goes on as a single extruder, no worse than sliced."""
    agent = DecMcts(problem, 0, seed=1, parameters=FEW)
    agent.iterate([0, 1])
    agent.forget(1)
    agent.iterate([0])
    found = agent.best([0])
    resolved = resolve(problem, found.plans, [0])
    assert len(resolved.toolpaths[0]) == len(problem.macro)
    sliced = Toolpath.as_sliced(len(problem.macro))
    before = schedule(
        problem.job,
        problem.machine,
        problem.graph,
        one_head_toolpaths(problem.job, problem.machine, sliced),
    )
    after = schedule(problem.job, problem.machine, problem.graph, resolved.toolpaths)
    assert after.makespan_s < before.makespan_s


@pytest.mark.slow
def test_a_team_is_faster_than_one(problem: TeamProblem) -> None:
    """The point of it all, on a print with room for two."""
    joint = plan_team(problem, time_limit_s=60.0, seed=0, max_rounds=2, parameters=FEW)
    one = DecMcts(problem, 0, seed=0)
    one.iterate([0])
    assert joint.makespan_s < 0.8 * one.best([0]).makespan_s


@pytest.mark.slow
def test_plans_of_unknown_heads_do_no_harm(problem: TeamProblem) -> None:
    """Its own distribution coming back, or a head that left, changes nothing."""
    agent = DecMcts(problem, 0, seed=1, parameters=FEW)
    twin = DecMcts(problem, 0, seed=1, parameters=FEW)
    agent.take(0, twin.distribution)
    agent.forget(7)
    agent.iterate([0, 1])
    twin.iterate([0, 1])
    assert np.array_equal(agent.distribution.likeliest(), twin.distribution.likeliest())


def test_a_head_must_exist(problem: TeamProblem) -> None:
    """Head 2 of two is a mistake of the caller."""
    with pytest.raises(InputError, match="head 2"):
        DecMcts(problem, 2, seed=0)


def test_rounds_shrink_with_the_print() -> None:
    """A round of a big print must end in about a second, or peers wait for nothing."""
    small, large = Parameters.for_contours(100), Parameters.for_contours(40_000)
    assert small.samples * small.updates > 10 * large.samples * large.updates >= 20


def test_the_distribution_sharpens(problem: TeamProblem) -> None:
    """What a head tells is worth listening to: it comes to prefer some of its plans."""
    parameters = Parameters(updates=10, samples=2, renew=1000)
    agents = [DecMcts(problem, r, seed=1, parameters=parameters) for r in range(2)]
    agents[0].iterate([0, 1])
    undecided = agents[0].distribution.entropy
    for _ in range(30):
        agents[0].iterate([0, 1])
    assert undecided == pytest.approx(1.0) and agents[0].distribution.entropy < 0.9


@pytest.mark.slow
@pytest.mark.parametrize("most", [0, 10_000])
def test_no_order_is_stated_that_would_not_fit_into_a_message(
    problem: TeamProblem, monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    """Of large prints the best joint plan is one of macro-actions."""
    monkeypatch.setattr(dec_mcts, "MOST_STATED", most)
    agent, n = DecMcts(problem, 0, seed=1, parameters=FEW), len(problem.macro)
    for _ in range(3):
        agent.iterate([0, 1])
    plans = agent.best([0, 1]).plans.values()
    stated = [decode(plan, problem.n_macros, n).stated is not None for plan in plans]
    assert any(stated) == bool(most)
