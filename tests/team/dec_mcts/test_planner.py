"""One head's planner: deterministic, never worse than where it began, alive alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.print.toolpath import Toolpath
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.dec_mcts import planner as dec_mcts
from decmcts.team.dec_mcts.planner import BestJointPlan, DecMcts, Parameters
from decmcts.team.dec_mcts.polish import Polish
from decmcts.team.dec_mcts.rounds import plan_in_turn
from decmcts.team.engine.alone import one_head_toolpaths
from decmcts.team.engine.plans import StatedOrder, decode, encode
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.resolve import resolve
from decmcts.team.engine.values import EACH
from decmcts.team.schedule.joint_plan import schedule

FEW = Parameters(share=0.1, samples=4, renew=1, windows=4, tries=8)


@pytest.fixture(autouse=True)
def short_rounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rounds without polishing are short enough for tests."""
    monkeypatch.setattr(dec_mcts, "UNPOLISHED", 15_000)


@pytest.fixture(scope="module")
def problem(case: Callable[..., Any]) -> TeamProblem:
    chosen = case(2, towers=8, reach=5.0)
    return build_team_problem(chosen.job, chosen.machine, chosen.graph)


def _rounds(problem: TeamProblem, seed: int) -> tuple[list[bytes], float]:
    """Two agents in turn, and all they told."""
    team = [DecMcts(problem, r, seed=seed, parameters=FEW) for r in range(2)]
    told: list[bytes] = []
    for _ in range(8):
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
    serial = 2 * float(problem.visits.seconds[0].sum())
    both = resolve(problem, {0: mine, 1: other}, [0, 1]).makespan_s
    alone = resolve(problem, {1: other}, [1]).makespan_s
    want = max(0.0, 1 - both / serial) - max(0.0, 1 - alone / serial)
    assert agent._values.utility(0, {0: mine, 1: other}, (0, 1)) == pytest.approx(want)


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
    """The point of it all, on a print with space for two."""
    joint = plan_in_turn(problem, stopping=Stopping(iterations=2), seed=0, parameters=FEW)
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


def test_a_large_print_gets_fewer_samples() -> None:
    """Each costs more: a round must end in seconds, and q be sharp before the time is up."""
    small, large = Parameters.for_contours(100), Parameters.for_contours(40_000)
    assert small.samples > large.samples >= 2
    assert small.plans > large.plans >= 2 and small.tries > large.tries >= 2


def _told(problem: TeamProblem, rounds: int, **values: Any) -> list[DecMcts]:
    """Two heads that plan in turn without polishing and tell each other their plans."""
    parameters = replace(FEW, windows=0, **values)
    team = [DecMcts(problem, r, seed=1, parameters=parameters) for r in range(2)]
    for _ in range(rounds):
        for agent in team:
            agent.iterate([0, 1])
            team[1 - agent.head].take(agent.head, agent.distribution)
    return team


@pytest.mark.slow
def test_the_distribution_sharpens(problem: TeamProblem) -> None:
    """What a head tells is worth listening to: it comes to prefer some of its plans."""
    agent = _told(problem, 4)[0]
    assert len(agent.distribution.sequences) > 2 and agent.distribution.entropy < 0.7


@pytest.mark.slow
def test_plans_are_told_as_soon_as_policies_are_tried(problem: TeamProblem) -> None:
    """Peers must have something to draw from the first round on."""
    agent = DecMcts(problem, 0, seed=1, parameters=replace(FEW, windows=0))
    assert len(agent.distribution.sequences) == 1
    agent.iterate([0, 1])
    assert len(agent.distribution.sequences) > 2
    mine = agent._values.starts[0, 1].plans[0]
    assert any(np.array_equal(mine, plan) for plan in agent.distribution.sequences)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.0, 0.1, 0.5])
def test_the_share_is_kept_by_the_count(problem: TeamProblem, share: float) -> None:
    """The work of tree and distribution is what was set, whatever the clock says."""
    agent = DecMcts(problem, 0, seed=1, parameters=replace(FEW, share=share))
    while agent._try_policies((0, 1)):
        pass
    before, allowed = agent._values.placed, 0
    for _ in range(3):
        agent._search((0, 1), agent._work(share))
        allowed += agent._work(share)
    order = len(problem.macro) + EACH
    one_update = (FEW.plans + 1) * 2 * order
    assert 0 <= agent._values.placed - before <= allowed + (one_update if share else 0)
    assert agent._credit < order and allowed == pytest.approx(share / (1 - share) * 36_000, abs=3)


@pytest.mark.slow
def test_no_step_is_taken_on_credit(problem: TeamProblem) -> None:
    """Of a large print one costs more than a round's share: the round waits until it has that."""
    agent, order = DecMcts(problem, 0, seed=1, parameters=FEW), len(problem.macro) + EACH
    while agent._try_policies((0, 1)):
        pass
    steps = agent._steps
    agent._search((0, 1), order // 2)
    assert agent._steps == steps
    agent._search((0, 1), order - order // 2)
    assert agent._steps > steps


@pytest.mark.slow
def test_a_head_begins_to_polish_with_the_best_it_was_told(problem: TeamProblem) -> None:
    """Of large prints there are few rounds: what others gained must not wait for the next."""
    first, second = (DecMcts(problem, r, seed=r, parameters=FEW) for r in range(2))
    for _ in range(4):
        first.iterate([0, 1])
    told = first.best([0, 1])
    while second._try_policies((0, 1)):
        pass
    assert told.makespan_s < second.best([0, 1]).makespan_s
    second.take_joint(told.plans, [0, 1])
    second.parameters = replace(FEW, windows=0)  # only what it was told can gain
    second._refine((0, 1), recreate=False)
    assert second._polishing is not None
    assert second._polishing.polish.best_s < second._polishing.polish.began_s


@pytest.mark.slow
def test_a_better_start_is_polished_and_not_the_order_it_replaces(problem: TeamProblem) -> None:
    """Joined with that order it would be that order again."""
    agent = DecMcts(problem, 0, seed=1, parameters=FEW)
    for _ in range(4):
        agent.iterate([0, 1])
    assert (
        agent._polishing is not None
        and agent._polishing.polish.best_s < agent._polishing.polish.began_s
    )
    agent._polishing = agent._polishing._replace(start_s=1e9)  # any start is much better
    agent.parameters = replace(FEW, windows=0)
    agent._refine((0, 1), recreate=False)
    assert agent._polishing.polish.best_s == agent._values.starts[0, 1].makespan_s


@pytest.mark.slow
@pytest.mark.parametrize(("first", "share"), [(0.5, 0.3), (0.0, 0.3), (0.5, 0.0)])
def test_polishing_begins_when_it_is_set_to(
    problem: TeamProblem, first: float, share: float
) -> None:
    """Tree and distribution come first, if they come at all."""
    agent = DecMcts(problem, 0, seed=1, parameters=replace(FEW, first=first, share=share))
    assert len(problem.macro) > dec_mcts.FEW
    while agent._try_policies((0, 1)):
        pass
    before, order = agent._values.placed, len(problem.macro) + EACH
    agent.iterate([0, 1], 0.4)
    alone = first > 0.4 and share > 0.0
    assert (agent._polishing is None) == alone
    assert (agent._values.placed - before > dec_mcts.UNPOLISHED - order) == alone
    agent.iterate([0, 1], 0.5)
    assert agent._polishing is not None


@pytest.mark.slow
def test_a_head_that_is_behind_goes_on_with_what_it_is_told(problem: TeamProblem) -> None:
    """Heads that polish different orders cannot join what they gain."""
    team = [DecMcts(problem, r, seed=r, parameters=FEW) for r in range(2)]
    for _ in range(4):
        for agent in team:
            agent.iterate([0, 1])
    ahead, behind = sorted(team, key=lambda agent: agent.best([0, 1]).makespan_s)
    told = ahead.best([0, 1])
    assert behind._polishing is not None
    assert ahead._polishing is not None
    ours, theirs = behind._polishing.polish.best_s, ahead._polishing.polish.best_s
    assert theirs < dec_mcts.BEHIND * ours
    behind.take_joint(told.plans, [0, 1])
    assert behind._polishing.polish.best_s <= theirs / dec_mcts.BEHIND
    behind.iterate([0, 1])
    assert behind.best([0, 1]).makespan_s <= told.makespan_s


def test_a_much_better_start_is_polished_anew_and_a_little_better_one_is_not() -> None:
    """What polishing has gained would be lost for less than it gains in as long again."""

    class Polished:
        began_s, best_s = 99.0, 89.0

    line = dec_mcts._Polishing((0, 1), Polished(), 100.0)  # type: ignore[arg-type]  # a fake
    assert not line.outdone_by(BestJointPlan({}, 97.0))
    assert line.outdone_by(BestJointPlan({}, 95.0))


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


@pytest.mark.slow
@pytest.mark.parametrize("ahead", [False, True])
def test_windows_are_improved_at_once_where_the_order_to_begin_with_is_ahead(
    case: Callable[..., Any], ahead: bool
) -> None:
    """Trees change little of a good sweep; else they have the first share of the time."""
    chosen = case(2, towers=8, reach=5.0)
    problem = build_team_problem(chosen.job, chosen.machine, chosen.graph)
    begun = Polish(problem, StatedOrder.of(_by_first_policy(problem)), seed=1)
    if ahead:
        begun.improve(40)
    parts = chosen.job, chosen.machine, chosen.graph
    problem = build_team_problem(*parts, start=begun.best if ahead else None)
    agent = DecMcts(problem, 0, seed=1, parameters=replace(FEW, first=0.5))
    while agent._try_policies((0, 1)):
        pass
    assert agent._begins_ahead((0, 1)) == ahead
    agent.iterate([0, 1], spent=0.1)
    assert (agent._polishing is not None) == ahead


def _by_first_policy(problem: TeamProblem) -> Sequence[Toolpath]:
    """Return the joint order of heads that all follow the first policy."""
    plans = {r: encode(0, problem.n_macros) for r in range(2)}
    return resolve(problem, plans, [0, 1]).toolpaths
