"""Heads beside one that is fenced: wherever they go in their reach, they do not come near."""

from __future__ import annotations

from dataclasses import replace

import pytest

from decmcts.errors import InputError
from decmcts.formats.machines.machine_file import load_machine
from decmcts.planning.replanning.fenced import fenced_places
from decmcts.planning.replanning.living import living_machine
from decmcts.print.print_state import HeadState, PrintState
from tests.makers.random_machines import random_machine
from tests.planning.replanning.conftest import Made


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
    with pytest.raises(InputError, match="every head is fenced"):
        living_machine(machine, both, made.document.contours)


def test_where_fenced_heads_stand() -> None:
    """As a person says; else where events saw it, else at its park."""
    machine = load_machine("dual-gantry")
    seen = HeadState("right", 3, at=(200.0, 50.0, 1.0), failed=True)
    state = PrintState((HeadState("left", 0), seen), None)  # type: ignore[arg-type]
    assert fenced_places([], machine, state, seen=True) == {"right": (200.0, 50.0, 1.0)}
    moved = fenced_places(["right=1,2,3"], machine, state, seen=True)
    assert moved == {"right": (1.0, 2.0, 3.0)}
    parked = fenced_places(["right=park"], machine, state, seen=True)
    assert parked == {"right": machine.heads[1].park}
    both = fenced_places(["left"], machine, state, seen=True)
    assert both["left"] == machine.heads[0].park


@pytest.mark.parametrize(
    ("said", "what"),
    [
        ("middle", "no head 'middle'"),
        ("right", "no event says where head right stands"),
        ("right=", "'' is no place"),
        ("right=1,2", "'1,2' is no place"),
        ("right=nan,1,2", "is no place"),
        ("right=1e9,1,2", "is no place"),
    ],
)
def test_bad_places_are_refused(said: str, what: str) -> None:
    """In one line."""
    machine = load_machine("dual-gantry")
    state = PrintState((HeadState("left", 0), HeadState("right", 0)), None)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=what):
        fenced_places([said], replace(machine), state, seen=False)
