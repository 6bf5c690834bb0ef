"""Heads that stand in the way: by boxes of whole moves, along rails, and what is printed there."""

from __future__ import annotations

from dataclasses import replace

import pytest

from decmcts.print.plan import JointPlan, PlanDocument
from sim.faults import FaultKind
from tests.planning.replanning.conftest import Made, faults_beside, made  # noqa: F401


@pytest.fixture
def left_alone(made: Made) -> PlanDocument:  # noqa: F811
    """What the left head does, which prints around x = 60, and one contour up to x = 260."""
    document = made.document
    machine = replace(document.machine, heads=document.machine.heads[:1], rails=())
    return replace(document, machine=machine, plan=JointPlan(document.plan.heads[:1]))


@pytest.mark.parametrize(
    ("place", "kinds"),
    [
        ((345.0, 150.0, 10.0), set()),
        ((300.0, 150.0, 10.0), {FaultKind.HEAD_HEAD}),  # 40 mm from the skirt, the rail asks 70
        ((240.0, 100.0, 0.1), {FaultKind.HEAD_HEAD, FaultKind.HEAD_MATERIAL}),
    ],
)
def test_a_head_that_stands_there(
    made: Made, left_alone: PlanDocument, place: tuple[float, float, float], kinds: set[FaultKind]  # noqa: F811
) -> None:  # fmt: skip
    """Nothing is said of one that stands far enough away."""
    faults = faults_beside(left_alone, made.document.machine, {"right": place})
    assert {fault.kind for fault in faults} == kinds


def test_a_head_may_stand_anywhere_on_a_line(made: Made, left_alone: PlanDocument) -> None:  # noqa: F811
    """Only the end of it is too near; and what is printed under its middle counts."""
    far, near = (345.0, 150.0, 10.0), (300.0, 150.0, 10.0)
    (fault,) = faults_beside(left_alone, made.document.machine, {"right": (far, near)})[:1]
    assert "which may stand from (345.00, 150.00, 10.00) to (300.00" in fault.text
    across = ((240.0, 20.0, 0.1), (240.0, 190.0, 0.1))
    faults = faults_beside(left_alone, made.document.machine, {"right": across})
    assert FaultKind.HEAD_MATERIAL in {fault.kind for fault in faults}


def test_without_a_rail_bodies_count(made: Made, left_alone: PlanDocument) -> None:  # noqa: F811
    """Two beams beside each other, 60 mm wide heads and 5 mm between them."""
    machine = replace(made.document.machine, rails=())
    assert faults_beside(left_alone, machine, {"right": (310.0, 150.0, 10.0)})
    assert not faults_beside(left_alone, machine, {"right": (330.0, 150.0, 10.0)})


def test_without_bodies_slices_count(made: Made, left_alone: PlanDocument) -> None:  # noqa: F811
    """Heads that are described by their slices alone may touch all the same."""
    whole = made.document.machine
    bare = replace(whole, rails=(), heads=tuple(replace(head, bodies=()) for head in whole.heads))
    alone = replace(left_alone, machine=replace(left_alone.machine, heads=bare.heads[:1]))
    faults = faults_beside(alone, bare, {"right": (262.0, 150.0, 3.0)})
    assert FaultKind.HEAD_HEAD in {fault.kind for fault in faults}
    assert not faults_beside(alone, bare, {"right": (380.0, 150.0, 3.0)})


def test_a_head_without_work_stands_at_its_park(made: Made, left_alone: PlanDocument) -> None:  # noqa: F811
    """There it may be in the way too."""
    idle = replace(left_alone, plan=JointPlan(()))
    assert faults_beside(idle, made.document.machine, {"right": (-45.0, 150.0, 10.0)})
    assert not faults_beside(idle, made.document.machine, {"right": (240.0, 100.0, 0.1)})
