"""Resolving plans: always a whole, safe order, and the same on every agent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.print.machine import Machine, MotionLimits
from decmcts.print.toolpath import Toolpath
from decmcts.team.engine.plans import POLICIES, encode, encode_serial
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.resolve import Resolved, resolve
from decmcts.team.schedule.joint_plan import schedule


@pytest.fixture(scope="module")
def problem(case: Callable[..., Any]) -> TeamProblem:
    chosen = case(3, towers=7)
    return build_team_problem(chosen.job, chosen.machine, chosen.graph)


def _check(problem: TeamProblem, resolved: Resolved) -> None:
    """Whole, and schedulable, which checks eligibility and precedence again."""
    printed = np.sort(np.concatenate([t.order for t in resolved.toolpaths]))
    assert np.array_equal(printed, np.arange(len(problem.macro)))
    schedule(problem.job, problem.machine, problem.graph, resolved.toolpaths)


def _random_plans(problem: TeamProblem, seed: int) -> dict[int, np.ndarray]:
    rng = np.random.default_rng(seed)
    plans = {}
    for r in range(2):
        shift = rng.integers(-100, 100, problem.n_macros).astype(np.int32)
        plans[r] = encode(int(rng.integers(len(POLICIES))), problem.n_macros, shift)
    return plans


@pytest.mark.parametrize("seed", range(12))
def test_any_plans_give_a_whole_order(problem: TeamProblem, seed: int) -> None:
    """Duplicates, orphans and odd orders all end in a plan that prints everything once."""
    _check(problem, resolve(problem, _random_plans(problem, seed), [0, 1]))


def test_same_in_same_out(problem: TeamProblem) -> None:
    """Agents compare digests before they commit: equal input must give equal bits."""
    plans = _random_plans(problem, 7)
    again = build_team_problem(problem.job, problem.machine, problem.graph)
    first, second = resolve(problem, plans, [0, 1]), resolve(again, plans, [1, 0])
    assert first.digest == second.digest
    assert first.makespan_s == second.makespan_s
    assert again.digest == problem.digest


def test_different_orders_have_different_digests(problem: TeamProblem) -> None:
    """A digest that does not see the order could commit two plans at once."""
    digests = {resolve(problem, _random_plans(problem, s), [0, 1]).digest for s in range(6)}
    assert len(digests) > 3


@pytest.mark.parametrize("live", [[0], [1]])
def test_a_dead_head_prints_nothing(case: Callable[..., Any], live: list[int]) -> None:
    """The others go on with its work."""
    chosen = case(5, towers=5, reach=4.0)
    problem = build_team_problem(chosen.job, chosen.machine, chosen.graph)
    resolved = resolve(problem, _random_plans(problem, 1), live)
    assert len(resolved.toolpaths[1 - live[0]]) == 0
    _check(problem, resolved)


def test_a_dead_head_that_was_needed(case_of: Callable[..., Any]) -> None:
    """What only the dead head reaches can not be printed: say so, do not drop it."""
    chosen = case_of([(112, 10, 0.5), (118, 10, 0.5)], [(30, 10, 0.5), (40, 10, 0.5)])
    problem = build_team_problem(chosen.job, chosen.machine, chosen.graph)
    with pytest.raises(InputError, match="no head of 'pair' can print contour 0"):
        resolve(problem, {}, [0])


@pytest.mark.parametrize("live", [[], [2], [-1, 0]])
def test_live_heads_must_exist(problem: TeamProblem, live: list[int]) -> None:
    """Nonsense about who is alive is refused."""
    with pytest.raises(InputError, match="live heads"):
        resolve(problem, {}, live)


def test_meaningless_symbols_are_skipped(problem: TeamProblem) -> None:
    """A peer's bad plan must not crash the planner."""
    bad = np.array([-5, 2**31 - 1, 3, 3, problem.n_macros + 999, 0], np.int32)
    _check(problem, resolve(problem, {0: bad, 1: np.empty(0, np.int32)}, [0, 1]))


def test_serial_plan_is_kept_to_the_letter(problem: TeamProblem) -> None:
    """The fall-back: one head's order printed as it is, by one head where it can."""
    n = len(problem.macro)
    toolpath = Toolpath.of(np.arange(n, dtype=np.int32), np.arange(n) % 2 == 1)
    resolved = resolve(problem, {0: encode_serial(toolpath, problem.n_macros)}, [0, 1])
    order = np.empty(n, np.int64)
    for part in resolved.toolpaths:
        assert part.turn is not None
        order[part.turn] = part.order
        assert np.array_equal(part.reversed, part.order % 2 == 1)
    eligible = problem.space.eligible.all(axis=1)
    assert np.array_equal(order[eligible[order]], np.flatnonzero(eligible))
    _check(problem, resolved)


def test_a_serial_plan_reverses_nothing_that_may_not_be_reversed(problem: TeamProblem) -> None:
    """A peer states it: the judge would refuse the plan once all heads had agreed on it."""
    n = len(problem.macro)
    toolpath = Toolpath.of(np.arange(n, dtype=np.int32), np.ones(n, np.bool_))
    resolved = resolve(problem, {0: encode_serial(toolpath, problem.n_macros)}, [0, 1])
    for part in resolved.toolpaths:
        assert np.array_equal(part.reversed, problem.visits.reversible[part.order])


def test_a_serial_plan_that_breaks_the_precedence_is_no_plan(problem: TeamProblem) -> None:
    """A head told such a plan by a peer would find no joint order at all and stop."""
    n = len(problem.macro)
    toolpath = Toolpath.of(np.arange(n, dtype=np.int32)[::-1].copy(), np.zeros(n, np.bool_))
    resolved = resolve(problem, {0: encode_serial(toolpath, problem.n_macros)}, [0, 1])
    assert resolved.digest == resolve(problem, {0: np.empty(0, np.int32)}, [0, 1]).digest
    _check(problem, resolved)


@pytest.mark.parametrize("seed", range(4))
def test_estimate_is_near_the_exact_plan(case: Callable[..., Any], seed: int) -> None:
    """The search optimises the estimate: the exact plan must not tell another story."""
    chosen = case(seed, towers=8)
    problem = build_team_problem(chosen.job, chosen.machine, chosen.graph)
    resolved = resolve(problem, {}, [0, 1])
    exact = schedule(chosen.job, chosen.machine, chosen.graph, resolved.toolpaths)
    assert exact.makespan_s == pytest.approx(resolved.makespan_s, rel=0.1)


def test_one_contour(case_of: Callable[..., Any]) -> None:
    """The smallest print of all."""
    chosen = case_of([(50, 10, 0.5), (60, 10, 0.5)])
    problem = build_team_problem(chosen.job, chosen.machine, chosen.graph)
    _check(problem, resolve(problem, {}, [0, 1]))


def test_nothing(case_of: Callable[..., Any]) -> None:
    """An empty print resolves to empty toolpaths."""
    chosen = case_of()
    problem = build_team_problem(chosen.job, chosen.machine, chosen.graph)
    assert resolve(problem, {}, [0, 1]).makespan_s == 0.0


def test_a_slower_head_is_given_less(case: Callable[..., Any]) -> None:
    """Heads are planned by the time each takes, and the exact schedule is no later."""
    slow = MotionLimits(max_acceleration=(60.0, 60.0, 50.0, 5000.0))
    shares, off = [], []
    for seed in range(4):
        chosen = case(seed, towers=8, reach=5.0)
        work = [len(path) for path in _resolved(chosen.machine, chosen).toolpaths]
        heads = (chosen.machine.heads[0], replace(chosen.machine.heads[1], limits=slow))
        machine = replace(chosen.machine, heads=heads)
        found = _resolved(machine, chosen)
        given = [len(path) for path in found.toolpaths]
        shares.append((work[1] / sum(work), given[1] / sum(given)))
        plan = schedule(chosen.job, machine, chosen.graph, found.toolpaths)
        off.append(found.makespan_s / plan.makespan_s)
    alike, slower = np.median(shares, axis=0)
    assert slower < 0.62 * alike
    assert min(off) > 1.0 and max(off) < 1.15


def _resolved(machine: Machine, chosen: Any) -> Resolved:
    problem = build_team_problem(chosen.job, machine, chosen.graph)
    return resolve(problem, {r: encode(0, problem.n_macros) for r in range(2)}, [0, 1])
