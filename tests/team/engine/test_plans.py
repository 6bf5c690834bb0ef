"""What the symbols of a plan mean, and the moves that change them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from decmcts.print.toolpath import Toolpath
from decmcts.team.dec_mcts.exchange import exchange, exchange_jointly
from decmcts.team.engine.plans import (
    MOST_SHIFT,
    POLICIES,
    StatedOrder,
    decode,
    encode,
    encode_serial,
    encode_stated,
)
from decmcts.team.engine.problem import build_team_problem


def test_a_plan_comes_back() -> None:
    """Encoding is undone by decoding."""
    shift = np.array([4, 0, -2], np.int32)
    intent = decode(encode(3, 3, shift), 3, 50)
    assert intent.shift.tolist() == [4, 0, -2]
    assert intent.policy == 3
    assert intent.serial is None


def test_a_plan_without_shifts_is_short() -> None:
    """Most plans that are told are, and messages are small."""
    plan = encode(3, 9, np.zeros(9, np.int32))
    assert plan.tolist() == [12]
    assert decode(plan, 9, 50).shift.tolist() == [0] * 9


def test_a_serial_plan_comes_back() -> None:
    """Orders and directions survive."""
    toolpath = Toolpath.of(np.array([2, 0, 1], np.int32), np.array([True, False, True]))
    intent = decode(encode_serial(toolpath, 9), 9, 3)
    assert intent.serial is not None
    assert intent.serial.order.tolist() == [2, 0, 1]
    assert intent.serial.reversed.tolist() == [True, False, True]


def test_a_stated_order_comes_back() -> None:
    """Who prints what, in which order and direction, survives."""
    order, is_reversed = np.array([2, 0, 1], np.int32), np.array([True, False, True])
    plan = encode_stated(StatedOrder(order, is_reversed, np.array([2, 0, 1])), 3, 9)
    stated = decode(plan, 9, 3).stated
    assert stated is not None
    assert stated.order.tolist() == [2, 0, 1]
    assert stated.reversed.tolist() == [True, False, True]
    assert stated.head.tolist() == [2, 0, 1]
    assert decode(plan, 9, 4).stated is None
    plan[-1] = plan[-2]
    assert decode(plan, 9, 3).stated is None


def test_policies_differ_and_cover_the_range() -> None:
    """Alike ones would be tried in vain."""
    assert len(np.unique(POLICIES, axis=0)) == len(POLICIES)
    assert (POLICIES[:, 0] > 0).all()
    assert POLICIES[:, 0].max() > 100 * POLICIES[:, 0].min()


@pytest.mark.parametrize(
    "symbols",
    [[], [-1], [10**9], [9 + len(POLICIES), 0, 0, 0], [9 + len(POLICIES), 0, 2]],
)
def test_nonsense_means_nothing(symbols: list[int]) -> None:
    """A serial plan that is not a whole order is no serial plan."""
    intent = decode(np.array(symbols, np.int32), 9, 3)
    assert intent.serial is None
    assert intent.policy == 0


@pytest.mark.parametrize("count", [1, 8, 10])
def test_shifts_for_another_number_of_macros_mean_nothing(count: int) -> None:
    """The policy still counts."""
    intent = decode(np.array([9 + 5, *range(count)], np.int32), 9, 3)
    assert intent.policy == 5 and not intent.shift.any()


def test_shifts_have_limits() -> None:
    """A peer's huge ones must not overflow."""
    plan = np.array([3, 2**31 - 1, -(2**31), 7], np.int32)
    assert decode(plan, 3, 9).shift.tolist() == [MOST_SHIFT, -MOST_SHIFT, 7]


@pytest.mark.parametrize("seed", range(20))
def test_moves_keep_plans_sound(case: Callable[..., Any], seed: int) -> None:
    """After any move there is a known policy and a shift within limits for each macro-action."""
    chosen = case(1)
    problem = build_team_problem(chosen.job, chosen.machine, chosen.graph)
    rng = np.random.default_rng(seed)
    plans = {r: encode(0, problem.n_macros) for r in range(2)}
    for _ in range(10):
        plans = exchange_jointly(problem, plans, rng)
        plans[0] = exchange(problem, 0, plans[0], rng)
        for plan in plans.values():
            intent = decode(plan, problem.n_macros, len(problem.macro))
            assert plan.dtype == np.int32
            assert len(plan) in (1, problem.n_macros + 1)
            assert 0 <= intent.policy < len(POLICIES)
            assert (intent.shift >= -MOST_SHIFT).all() and (intent.shift <= MOST_SHIFT).all()
