"""The window along a rail in which too few heads find space."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from decmcts.formats.machines.machine_file import load_machine
from decmcts.team.engine.problem import bottleneck


def _boxes(x: list[float]) -> np.ndarray:
    return np.array([[v, v + 10.0, 0.0, 10.0] for v in x])


def test_two_heads_hinder_each_other_within_one_separation() -> None:
    """The contours of the fullest window, and no others."""
    machine = load_machine("dual-gantry")
    apart = machine.rails[0].separation_mm
    boxes = _boxes([0.0, 5.0, 2.5 * apart, 4.0 * apart])
    assert bottleneck(boxes, np.ones(4), machine).tolist() == [True, True, False, False]
    heavy = np.array([1.0, 1.0, 5.0, 1.0])
    assert bottleneck(boxes, heavy, machine).tolist() == [False, False, True, False]


def test_more_heads_find_space_in_wider_windows() -> None:
    """Eight heads: what is the most work for each of those that fit."""
    machine = load_machine("rail-8")
    apart = machine.rails[0].separation_mm
    boxes = _boxes([0.2 * apart, 0.9 * apart, 1.6 * apart, 6.0 * apart])
    inside = bottleneck(boxes, np.array([2.0, 2.0, 2.0, 1.0]), machine)
    assert not inside[3]
    assert inside[:3].sum() >= 2


def test_there_is_none_without_a_rail_or_work() -> None:
    """Heads that may pass one another, and an empty print."""
    machine = load_machine("dual-gantry")
    free = replace(machine, rails=())
    assert not bottleneck(_boxes([0.0, 5.0]), np.ones(2), free).any()
    assert bottleneck(np.empty((0, 4)), np.empty(0), machine).shape == (0,)
