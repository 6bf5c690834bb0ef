"""What the symbols of a plan mean, and the moves that change them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from decmcts.print.toolpath import Toolpath
from decmcts.team.exchange import exchange, exchange_jointly
from decmcts.team.plans import (
    POLICIES,
    StatedOrder,
    decode,
    encode,
    encode_serial,
    encode_stated,
)
from decmcts.team.problem import build_team_problem


def test_a_plan_comes_back() -> None:
    """Encoding is undone by decoding."""
    macros = np.array([4, 0, 2], np.int32)
    intent = decode(encode(macros, 3, 9), 9, 50)
    assert intent.macros.tolist() == [4, 0, 2]
    assert intent.policy == 3
    assert intent.serial is None


def test_a_serial_plan_comes_back() -> None:
    """Orders and directions survive."""
    toolpath = Toolpath.of(np.array([2, 0, 1], np.int32), np.array([True, False, True]))
    intent = decode(encode_serial(toolpath, 9), 9, 3)
    assert intent.serial is not None
    assert intent.serial.order.tolist() == [2, 0, 1]
    assert intent.serial.reversed.tolist() == [True, False, True]


def test_a_stated_order_comes_back() -> None:
    """Who prints what, in which order and direction, survives."""
    order, backwards = np.array([2, 0, 1], np.int32), np.array([True, False, True])
    plan = encode_stated(StatedOrder(order, backwards, np.array([2, 0, 1])), 3, 9)
    stated = decode(plan, 9, 3).stated
    assert stated is not None
    assert stated.order.tolist() == [2, 0, 1]
    assert stated.backwards.tolist() == [True, False, True]
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


def test_doubled_macros_count_once() -> None:
    """The first mention counts."""
    assert decode(np.array([5, 3, 5, 1], np.int32), 9, 3).macros.tolist() == [5, 3, 1]


@pytest.mark.parametrize("seed", range(20))
def test_moves_keep_plans_sound(case: Callable[..., Any], seed: int) -> None:
    """After any move each macro-action is named at most once, under a known policy."""
    chosen = case(1)
    problem = build_team_problem(chosen.job, chosen.machine, chosen.graph)
    rng = np.random.default_rng(seed)
    plans = {r: encode(problem.sides_of(r), 0, problem.n_macros) for r in range(2)}
    for _ in range(10):
        plans = exchange_jointly(problem, plans, rng)
        plans[0] = exchange(problem, plans[0], rng)
        for plan in plans.values():
            intent = decode(plan, problem.n_macros, len(problem.macro))
            assert plan.dtype == np.int32
            assert len(plan) == len(intent.macros) + 1
