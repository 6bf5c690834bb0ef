"""An order to begin with as macro-actions, and what the heads' plans make of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from decmcts.team.dec_mcts.exchange import exchange, exchange_jointly
from decmcts.team.engine.plans import (
    MOST_LATER,
    Changes,
    StatedOrder,
    decode,
    encode,
    encode_changes,
    encode_stated,
    means_something,
)
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.resolve import is_allowed, resolve
from decmcts.team.engine.start import changed_order, start_of

HEADS = (0, 1)


@pytest.fixture(scope="module")
def problem(case: Callable[..., Any]) -> TeamProblem:
    """A print whose heads begin with what they would do by the first policy."""
    chosen = case(2, towers=6, reach=5.0)
    plain = build_team_problem(chosen.job, chosen.machine, chosen.graph)
    begun = StatedOrder.of(resolve(plain, {}, HEADS).toolpaths)
    return build_team_problem(chosen.job, chosen.machine, chosen.graph, start=begun)


def plan_of(problem: TeamProblem, *rows: tuple[int, int, int]) -> np.ndarray:
    """Return the plan of changes (macro-action, half turns later, head)."""
    return encode_changes(Changes(*np.array(rows, np.int64).reshape(-1, 3).T), problem.n_macros)


def test_macro_actions_are_runs_of_one_head_on_one_layer() -> None:
    """And a long run, such as a strip and the middle behind it, is parted."""
    head = np.array([0, 0, 1, 1, 0, 0, 0, 0])
    order = np.array([1, 0, 2, 3, 4, 5, 6, 7], np.int32)
    stated = StatedOrder(order, np.zeros(8, np.bool_), head)
    layer = np.array([0, 0, 0, 1, 1, 1, 1, 1])
    found = start_of(stated, layer, np.arange(8.0), np.ones(8))
    assert found.macro.tolist() == [0, 0, 1, 2, 3, 3, 4, 4]
    assert found.head.tolist() == [0, 1, 1, 0, 0]
    assert found.layer.tolist() == [0, 0, 1, 1, 1]
    assert found.middle_mm.tolist() == [0.5, 2.0, 3.0, 4.5, 6.5]


def test_no_changes_are_the_order_to_begin_with(problem: TeamProblem) -> None:
    """Both heads', one head's, or beside a plan that has nothing to do with it."""
    assert problem.start is not None
    stated = encode_stated(problem.start.stated, 2, problem.n_macros)
    wanted = resolve(problem, {0: stated}, HEADS)
    nothing = plan_of(problem)
    for plans in (
        {0: nothing, 1: nothing},
        {1: nothing},
        {0: encode(3, problem.n_macros), 1: nothing},
    ):
        assert resolve(problem, plans, HEADS).digest == wanted.digest


def test_each_head_changes_only_its_own(problem: TeamProblem) -> None:
    """Two heads may say different things of one macro-action: its owner's word counts."""
    start = problem.start
    assert start is not None
    mine = int(np.flatnonzero(start.head == 0)[1])
    foreign, own = plan_of(problem, (mine, 7, 1)), plan_of(problem, (mine, 0, 1))
    nothing = plan_of(problem)
    assert (
        resolve(problem, {0: nothing, 1: foreign}, HEADS).digest
        == resolve(problem, {0: nothing, 1: nothing}, HEADS).digest
    )
    change = decode(own, problem.n_macros, 10**6).changes
    assert change is not None
    given = changed_order(start, {0: change}, problem.space.eligible, problem.graph)
    moved = start.macro[given.order] == mine
    may = problem.space.eligible[given.order, 1]
    assert (given.head[moved] == np.where(may[moved], 1, 0)).all() and may[moved].any()


def test_any_changes_make_an_order_that_keeps_the_precedence(problem: TeamProblem) -> None:
    """Sooner than what lies below it nothing can be."""
    start, rng = problem.start, np.random.default_rng(0)
    assert start is not None
    for _ in range(50):
        changes = {
            r: Changes(
                np.flatnonzero(rng.random(start.n_macros) < 0.3),
                *np.empty((2, 0), np.int64),
            )
            for r in HEADS
        }
        changes = {
            r: Changes(
                each.macro,
                rng.integers(-40, 40, len(each.macro)),
                rng.integers(0, 2, len(each.macro)),
            )
            for r, each in changes.items()
        }
        made = changed_order(start, changes, problem.space.eligible, problem.graph)
        assert sorted(made.order) == list(range(len(problem.macro)))
        assert is_allowed(problem, made, problem.space.eligible)


def test_changes_come_back_and_what_means_nothing_is_skipped() -> None:
    """Plans may come from peers."""
    plan = encode_changes(Changes(np.array([2, 5]), np.array([-3, 0]), np.array([1, 0])), 9)
    back = decode(plan, 9, 50).changes
    assert back is not None
    assert [row.tolist() for row in (back.macro, back.later, back.head)] == [
        [2, 5],
        [-3, 0],
        [1, 0],
    ]
    assert means_something(plan, 9, 50, 2)
    for place, value in ((1, -1), (2, MOST_LATER + 1), (3, -1), (3, 2), (4, 2), (4, 50)):
        spoilt = plan.copy()
        spoilt[place] = value
        assert not means_something(spoilt, 9, 50, 2)
    assert not means_something(plan[:-1], 9, 50, 2)


@pytest.mark.parametrize("head", HEADS)
def test_moves_of_the_tree_change_what_each_head_may_change(
    problem: TeamProblem, head: int
) -> None:
    """One head's move is its own; together both make the same."""
    start, rng = problem.start, np.random.default_rng(3)
    assert start is not None
    plan, kinds = plan_of(problem), set()
    for _ in range(200):
        before = plan if rng.random() < 0.5 else plan_of(problem)
        plan = exchange(problem, head, before, rng)
        found = decode(plan, problem.n_macros, len(problem.macro)).changes
        assert found is not None and (start.head[found.macro] == head).all()
        given = found.head != head
        kinds |= {("later", bool(found.later.any())), ("given", bool(given.any()))}
    assert kinds == {("later", True), ("later", False), ("given", True), ("given", False)}
    both = exchange_jointly(problem, {0: plan, 1: plan_of(problem)}, rng)
    assert set(both) == {0, 1}


def test_another_order_to_begin_with_is_another_problem(problem: TeamProblem) -> None:
    """Agents with unequal ones would resolve the same plans differently."""
    job, machine, graph = problem.job, problem.machine, problem.graph
    plain = build_team_problem(job, machine, graph)
    again = build_team_problem(job, machine, graph, start=problem.start.stated)  # type: ignore[union-attr]  # it has one
    assert again.digest == problem.digest != plain.digest
