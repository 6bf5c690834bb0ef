"""One head for everything."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.print.toolpath import Toolpath
from decmcts.team.engine.alone import lone_machine, one_head_toolpaths
from decmcts.team.schedule.joint_plan import schedule


def test_the_yardstick_reaches_everything(case_of: Callable[..., Any]) -> None:
    """Two strokes no single head reaches both: the yardstick prints them one after the other."""
    chosen = case_of([(112, 10, 0.5), (118, 10, 0.5)], [(2, 10, 0.5), (8, 10, 0.5)])
    one = schedule(chosen.job, lone_machine(chosen.machine), chosen.graph, [Toolpath.as_sliced(2)])
    printing = one.heads[0].kind == 0
    begin, end = one.heads[0].begin_s[printing], one.heads[0].end_s[printing]
    assert begin[1] >= end[0]


def test_only_live_heads_share(case_of: Callable[..., Any]) -> None:
    """A dead head gets nothing; what only it reaches is refused."""
    chosen = case_of([(50, 10, 0.5), (60, 10, 0.5)])
    shared = one_head_toolpaths(chosen.job, chosen.machine, Toolpath.as_sliced(1), live=[1])
    assert [len(t) for t in shared] == [0, 1]
    far = case_of([(2, 10, 0.5), (8, 10, 0.5)])
    with pytest.raises(InputError, match="no head"):
        one_head_toolpaths(far.job, far.machine, Toolpath.as_sliced(1), live=[1])


@pytest.mark.parametrize("seed", range(3))
def test_the_order_is_kept(case: Callable[..., Any], seed: int) -> None:
    """Shared toolpaths put together by turn are the order they came from."""
    chosen = case(seed)
    n = len(chosen.job.contours)
    shared = one_head_toolpaths(chosen.job, chosen.machine, Toolpath.as_sliced(n))
    order = np.empty(n, np.int64)
    for toolpath in shared:
        order[toolpath.turn] = toolpath.order
    assert np.array_equal(order, np.arange(n))


@pytest.mark.parametrize(("x", "heads"), [(30.0, [1, 0]), (90.0, [0, 1])])
def test_of_heads_that_can_do_the_same_the_nearest_does(
    case_of: Callable[..., Any], x: float, heads: list[int]
) -> None:
    """The head that parks farthest away would send all others across the bed and back."""
    chosen = case_of([(x, 10, 0.5), (x + 5, 10, 0.5)])
    shared = one_head_toolpaths(chosen.job, chosen.machine, Toolpath.as_sliced(1))
    assert [len(t) for t in shared] == heads


def test_the_yardstick_is_the_quickest_head(case_of: Callable[..., Any]) -> None:
    """A slow first head made the other one, alone, seem 3.5 times as fast as one head."""
    machine = case_of([(50, 10, 0.5), (60, 10, 0.5)]).machine
    slow = replace(machine.heads[0], pace=3.5)
    weak = replace(machine.heads[0], limits=replace(machine.limits, travel_feed=20.0))
    for head in (slow, weak):
        team = replace(machine, heads=(head, machine.heads[1]))
        assert lone_machine(team).heads[0].name == machine.heads[1].name
    assert lone_machine(machine).heads[0].name == machine.heads[0].name


def test_of_heads_that_can_do_the_same_the_quickest_does(case_of: Callable[..., Any]) -> None:
    """Be it the farther one: the whole print takes as long as it does."""
    chosen = case_of([(30, 10, 0.5), (35, 10, 0.5)])
    slow = replace(chosen.machine.heads[0], pace=2.0)
    machine = replace(chosen.machine, heads=(slow, chosen.machine.heads[1]))
    shared = one_head_toolpaths(chosen.job, machine, Toolpath.as_sliced(1))
    assert [len(t) for t in shared] == [0, 1]
