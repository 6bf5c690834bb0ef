"""Ways to the parks: one head after another, clear of all that stands."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.formats.plans.plan_json import read_plan, write_plan
from decmcts.planning.running.renewing import parking_plan
from decmcts.print.machine import Fenced
from sim.controllers.feeding import Work
from sim.controllers.from_plan import programs_of_plan
from sim.controllers.simulate import simulate
from tests.planning.replanning.conftest import Made


def test_heads_go_up_across_and_down_and_do_not_touch(made: Made) -> None:
    """Under any timing: each waits for the one before."""
    machine = made.document.machine
    places = {"left": (100.0, 100.0, 0.6), "right": (200.0, 100.0, 0.6)}
    plan = parking_plan(made.document, machine, places, {})
    assert plan is not None
    top = float(made.document.contours.points[:, 2].max())
    for head in plan.plan.heads:
        park = next(one.park for one in machine.heads if one.name == head.head)
        path = head.action_path(0)
        assert tuple(path[-1]) == park and path[1:-1, 2].min() > top
        assert np.array_equal(path[0, :2], path[1, :2])
    found = simulate(programs_of_plan(plan), machine)
    assert found.safe and found.contacts == 0


def test_heads_that_are_parked_do_not_move(made: Made, tmp_path: Path) -> None:
    """They take the plan up all the same, so that others know that they stand."""
    machine = made.document.machine
    parks = {head.name: head.park for head in machine.heads}
    places = {**parks, "right": (200.0, 100.0, 0.6)}
    plan = parking_plan(made.document, machine, places, {})
    assert plan is not None
    write_plan(plan, tmp_path / "plan.json")
    counts = {head.head: len(head) for head in read_plan(tmp_path / "plan.json").plan.heads}
    assert counts == {"left": 0, "right": 1}
    at, work = parks["left"], Work.of_plan(plan, "left")
    assert len(work) == 0 and work.at(0, 1.0) == at
    assert parking_plan(made.document, machine, {}, parks) is None


def test_a_head_in_the_way_is_named(made: Made) -> None:
    """A dead head right of where the right one parks lets nobody pass."""
    machine = made.document.machine
    with pytest.raises(InputError, match="no clear path"):
        parking_plan(
            made.document, machine, {"right": (100.0, 100.0, 0.6)}, {"left": (300.0, 100.0, 0.6)}
        )


def test_heads_go_to_their_parks_from_a_plan_around_another_that_failed(
    made: Made, tmp_path: Path
) -> None:
    """It moves in this plan, or stands in its way; a run ended over it when a second one failed."""
    machine = made.document.machine
    left, right = machine.heads
    around = replace(made.document, fenced=Fenced(machine, {"right": right.park}))
    for standing, others in (
        ({"left": (100.0, 100.0, 0.6)}, {"right": right.park}),
        ({"right": (200.0, 100.0, 0.6)}, {"left": left.park}),
    ):
        plan = parking_plan(around, machine, standing, others)
        assert plan is not None
        write_plan(plan, tmp_path / "plan.json")
        assert [head.head for head in read_plan(tmp_path / "plan.json").plan.heads] == [*standing]
