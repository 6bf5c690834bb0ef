"""Heads beside one that is fenced: wherever they go in their reach, they do not come near."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.formats.machines.machine_file import load_machine
from decmcts.formats.plans.plan_json import read_plan, write_plan
from decmcts.planning.replanning.fenced import fenced_places, late_heads, living_machine
from decmcts.print.machine import Fenced, line_of
from decmcts.print.plan import JointPlan
from decmcts.print.print_state import HeadState, PrintState, state_of_events
from tests.makers.random_machines import random_machine
from tests.planning.replanning.conftest import Made, log_until, within_print


def test_on_a_rail_the_separation_is_kept(made: Made) -> None:
    """Between the nozzles, along the rail."""
    machine = load_machine("dual-gantry")
    lone = living_machine(machine, {"right": (200.0, 50.0, 3.0)}, made.document.contours)
    assert [head.name for head in lone.heads] == ["left"] and not lone.rails
    assert lone.heads[0].reach_max[0] == pytest.approx(130.0, abs=0.1)
    lone = living_machine(machine, {"left": (100.0, 50.0, 3.0)}, made.document.contours)
    assert lone.heads[0].reach_min[0] == pytest.approx(170.0, abs=0.1)


def test_a_parked_head_takes_nothing(made: Made) -> None:
    """Of this machine: parks lie beyond what the other reaches."""
    machine = load_machine("dual-gantry")
    right = next(head for head in machine.heads if head.name == "right")
    lone = living_machine(machine, {"right": right.park}, made.document.contours)
    assert lone.heads[0].reach_max == machine.heads[0].reach_max


@pytest.mark.parametrize("seed", range(40))
def test_heads_of_any_machine_keep_away(made: Made, seed: int) -> None:
    """Boxes around reach and park, widened by the heads, do not touch the one that is fenced."""
    machine = random_machine(seed)
    gone = machine.heads[seed % len(machine.heads)]
    try:
        living = living_machine(machine, {gone.name: gone.park}, made.document.contours)
    except InputError as error:
        assert "parks where it could touch" in str(error)
        return
    assert gone.name not in [head.name for head in living.heads]
    assert not any(gone.name in rail.order for rail in living.rails)
    for head in living.heads:
        for ours in head.bodies:
            for theirs in gone.bodies:
                apart = False
                for axis in (0, 1):
                    low = min(head.reach_min[axis], head.park[axis]) + ours.minimum[axis]
                    high = max(head.reach_max[axis], head.park[axis]) + ours.maximum[axis]
                    here = gone.park[axis]
                    apart |= low >= here + theirs.maximum[axis] + machine.head_clearance_mm
                    apart |= high <= here + theirs.minimum[axis] - machine.head_clearance_mm
                assert apart, (head.name, ours.name, theirs.name)


def test_heads_that_cannot_be_kept_away_are_refused(made: Made) -> None:
    """One parks where the fenced one stands; or none is left."""
    machine = load_machine("dual-gantry")
    with pytest.raises(InputError, match="left parks where it could touch head right"):
        living_machine(machine, {"right": (-20.0, 150.0, 3.0)}, made.document.contours)
    both = {"left": (0.0, 0.0, 0.0), "right": (300.0, 0.0, 0.0)}
    with pytest.raises(InputError, match=r"every head is fenced.* --layer N or --height Z"):
        living_machine(machine, both, made.document.contours)


def test_where_fenced_heads_stand(made: Made) -> None:
    """As a person says; else where events saw it, else at its park."""
    machine = made.document.machine
    seen = HeadState("right", 3, at=(200.0, 50.0, 1.0), failed=True)
    state = PrintState((HeadState("left", 0), seen), None)  # type: ignore[arg-type]
    assert fenced_places([], made.document, state, seen=True) == {"right": ((200.0, 50.0, 1.0),)}
    moved = fenced_places(["right=100,2,3"], made.document, state, seen=True)
    assert moved == {"right": (100.0, 2.0, 3.0)}
    parked = fenced_places(["right=park"], made.document, state, seen=True)
    assert parked == {"right": machine.heads[1].park}
    both = fenced_places(["left"], made.document, state, seen=True)
    assert both["left"] == (machine.heads[0].park,)


def test_a_head_that_did_not_fail_may_have_gone_on(made: Made) -> None:
    """It counted as where it was seen last: another went where it may have stood by then."""
    time_s, k = within_print(made.document, 0, 30.0)
    state = state_of_events(made.document, log_until(made.document, time_s))
    stands = fenced_places(["left"], made.document, state, seen=True)
    path = made.document.plan.heads[0].action_path(k)
    assert np.array_equal(line_of(stands["left"]), path)
    assert path[0, 0] + 5.0 < path[:, 0].max()
    lone = living_machine(made.document.machine, stands, made.document.contours)
    assert lone.heads[0].reach_min[0] == pytest.approx(path[:, 0].max() + 70.0)


def test_where_a_head_may_stand_is_kept_in_its_plan(made: Made, tmp_path: Path) -> None:
    """A line as its points, a place as before."""
    for stands in (((200.0, 50.0, 1.0), (220.0, 50.0, 1.0)), (200.0, 50.0, 1.0)):
        lone = made.document.machine.of_heads(made.document.machine.heads[:1])
        fenced = Fenced(made.document.machine, {"right": stands})
        path = tmp_path / "plan.json"
        write_plan(replace(made.document, machine=lone, plan=JointPlan(()), fenced=fenced), path)
        found = read_plan(path).fenced
        assert found is not None and found.at == {"right": stands}


@pytest.mark.parametrize(
    ("said", "what"),
    [
        ("middle", "no head 'middle'"),
        ("right", "no event says where head right stands"),
        ("right=", "'' is no place"),
        ("right=1,2", "'1,2' is no place"),
        ("right=nan,1,2", "is no place"),
        ("right=1e9,1,2", "is no place"),
        ("right=2000,50,1", "right cannot be at X 2000: with its park it reaches 30 to 345 mm"),
        ("right=200,50,-20", "right cannot be at Z -20"),
    ],
)
def test_bad_places_are_refused(made: Made, said: str, what: str) -> None:
    """In one line."""
    state = PrintState((HeadState("left", 0), HeadState("right", 0)), None)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=what):
        fenced_places([said], made.document, state, seen=False)


def test_a_head_is_named_once(made: Made) -> None:
    """Of two places the last one counted, and others could come near the head at the first."""
    state = PrintState((HeadState("left", 0), HeadState("right", 0)), None)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="--fenced right=200,50,1: head right is named twice"):
        fenced_places(["right=park", "right=200,50,1"], made.document, state, seen=False)
    with pytest.raises(InputError, match="--slower left=3: head left is named twice"):
        late_heads(["left=2", "left=3"], made.document.machine)
