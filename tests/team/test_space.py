"""The room heads need, against boxes moved by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from decmcts._kernels.conflict import conflicts
from decmcts.print.machine import Body, Machine, Rail
from decmcts.team.space import build_space, head_gaps


@pytest.fixture
def loose(case: Callable[..., Any]) -> Machine:
    """The pair without its rail, with uneven bodies."""
    machine = case(0).machine
    heads = (
        replace(machine.heads[0], bodies=(Body("duct", (-12, -3, 5), (5, 4, 20)),)),
        replace(machine.heads[1], bodies=(Body("fan", (-6, -9, 5), (7, 15, 20)),)),
    )
    return replace(machine, heads=heads, rail=None, head_clearance_mm=2.0)


@pytest.mark.parametrize("seed", range(5))
def test_clear_boxes_keep_bodies_apart(loose: Machine, seed: int) -> None:
    """If the boxes are clear, no two positions in them bring the outlines nearer than allowed."""
    rng = np.random.default_rng(seed)
    gaps = head_gaps(loose)
    low, high = np.array([[-12, -8], [-8, -9]]), np.array([[8, 8], [8, 15]])
    for _ in range(200):
        corners = np.sort(rng.uniform(0, 60, (2, 2, 2)), axis=2)  # head, axis, low/high
        boxes = corners.reshape(2, 4)
        apart = [
            max(
                corners[1, a, 0] + low[1, a] - corners[0, a, 1] - high[0, a],
                corners[0, a, 0] + low[0, a] - corners[1, a, 1] - high[1, a],
            )
            for a in range(2)
        ]
        assert conflicts(boxes[0], boxes[1], gaps[0, 1]) == (max(apart) < 2.0)
        assert conflicts(boxes[1], boxes[0], gaps[1, 0]) == (max(apart) < 2.0)


def test_a_rail_keeps_the_order(case: Callable[..., Any]) -> None:
    """On a rail being apart the wrong way round is a conflict too."""
    gaps = head_gaps(case(0).machine)
    left, right = np.array([10.0, 20, 0, 5]), np.array([44.0, 50, 0, 5])
    assert not conflicts(left, right, gaps[0, 1])
    assert conflicts(left, right, gaps[1, 0])
    assert conflicts(left + np.array([0.1, 0.1, 0, 0]), right, gaps[0, 1])


def test_wide_bodies_need_more_than_the_rail_says(case: Callable[..., Any]) -> None:
    """The larger of separation and bodies counts."""
    machine = case(0).machine
    wide = tuple(replace(h, bodies=(Body("beam", (-30, 0, 5), (30, 1, 9)),)) for h in machine.heads)
    gaps = head_gaps(replace(machine, heads=wide, rail=Rail(0, ("left", "right"), 24.0)))
    assert gaps[0, 1, 0] == 61.0


def test_tools_and_parks_limit_who_may_print(case_of: Callable[..., Any]) -> None:
    """A head without the tool, or that would have to pass the other's park, may not."""
    chosen = case_of([(50, 10, 0.5), (60, 10, 0.5)], [(100, 10, 0.5), (105, 10, 0.5)])
    heads = list(chosen.machine.heads)
    heads[1] = replace(heads[1], tools=(1,), park=(125.0, 30.0, 5.0))
    machine = replace(chosen.machine, heads=tuple(heads))
    eligible = build_space(chosen.job.contours, machine).eligible
    assert eligible.tolist() == [[True, False], [False, False]]


def test_one_head_has_no_one_in_its_way(case: Callable[..., Any]) -> None:
    """A machine of one head is the plain case of the same code."""
    machine = case(0).machine
    alone = replace(machine, heads=machine.heads[:1], rail=None)
    assert head_gaps(alone).shape == (1, 1, 4)
