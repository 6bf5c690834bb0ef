"""What keeps nozzles apart, and in which order heads stand."""

from __future__ import annotations

from dataclasses import replace

import pytest

from decmcts.formats.machines.machine_file import load_machine
from decmcts.print.kinematics import (
    FixedOrder,
    Separation,
    fixed_order,
    line_up,
    separations,
    widest,
)
from decmcts.print.machine import Head, Rail
from sim.replay.shapes import separations_between


def test_heads_of_a_rail_keep_their_order() -> None:
    """Planner and judge agree on every pair, and the order is that of the parks."""
    machine = load_machine("rail-4")
    rail = machine.rails[0]
    assert fixed_order(machine) == FixedOrder(rail.axis, rail.separation_mm)
    assert separations(machine, "head-1", "head-3") == (Separation(0, 1, 2 * rail.separation_mm),)
    assert separations(machine, "head-3", "head-1") == (Separation(0, -1, 2 * rail.separation_mm),)
    for a in machine.heads:
        assert separations(machine, a.name, a.name) == ()
        for b in machine.heads:
            if a is not b:
                found = [(s.axis, s.side, s.least_mm) for s in separations(machine, a.name, b.name)]
                assert found == separations_between(machine, a, b)
    assert line_up(machine) == (0, (0, 1, 2, 3))
    mixed = replace(machine, heads=tuple(machine.heads[h] for h in (2, 0, 3, 1)))
    assert line_up(mixed) == (0, (1, 3, 0, 2))


def test_heads_without_a_rail_stand_as_they_park() -> None:
    machine = load_machine("dueling-zero")
    assert fixed_order(machine) is None and widest(machine) is None
    assert separations(machine, "left", "right") == ()
    assert line_up(machine) == (0, (0, 1))
    assert line_up(replace(machine, heads=machine.heads[::-1])) == (0, (1, 0))


@pytest.mark.parametrize("rails", [2, 1])
def test_the_widest_rail_gives_the_axis(rails: int) -> None:
    heads = tuple(Head(name, (), park=(x, y, 10.0)) for name, x, y in (
        ("a", 0.0, 0.0), ("b", 100.0, 200.0), ("c", 300.0, 100.0)))  # fmt: skip
    both = (Rail(0, ("a", "b"), 40.0), Rail(1, ("a", "c"), 70.0))[:rails]
    machine = replace(load_machine("dueling-zero"), heads=heads, rails=both)
    assert fixed_order(machine) is None
    assert line_up(machine) == ((1, (0, 2, 1)) if rails == 2 else (0, (0, 1, 2)))
