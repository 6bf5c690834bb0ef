"""Valid plans pass; the mutation tests are in test_mutations."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.print.machine import Head, Machine, Slice
from decmcts.print.plan import JointPlan, PlanDocument
from sim.verify import verify_plan


def test_a_good_one_head_plan_has_no_fault(make):
    """A judge that cries wolf would stop every good print."""
    assert verify_plan(make.tower_plan()).faults == ()


def test_a_good_two_head_plan_has_no_fault(make):
    """Heads that share a place in turn, ordered by `after`, are allowed."""
    assert verify_plan(make.two_head_plan()).faults == ()


def test_towers_too_near_for_the_head_are_found(make):
    """The second tower stands beside a finished one: the head's box meets it."""
    verdict = verify_plan(make.tower_plan(towers=((20.0, 20.0), (26.0, 20.0))))
    assert {kind.name for kind in verdict.kinds()} == {"HEAD_MATERIAL"}


@pytest.mark.parametrize(("width", "kinds"), [(0.5, set()), (4.0, {"HEAD_MATERIAL"})])
def test_a_head_that_does_nothing_stands_at_its_park(make, width, kinds):
    """A bead laid into it is a crash although that head has no action."""
    halves = [half * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]]) for half in (0.5, 5.0)]
    busy = Head("busy", (Slice(0.0, (halves[0],)),), park=(20.0, 90.0, 5.0))
    idle = Head("idle", (Slice(0.0, (halves[1],)),), park=(50.0, 50.0, 0.1))
    machine = Machine("m", (0.0, 0.0), (100.0, 100.0), (busy, idle), head_clearance_mm=0.2)
    paths = [np.array([[30.0, 55.75, 0.4], [70.0, 55.75, 0.4]])]
    actions = make.head_actions(busy, [(0, False)], paths, 0, clearance_z=1.0)
    document = PlanDocument(
        "", machine, make.contours_of(paths, width=width), np.empty((0, 2), np.int32),
        JointPlan((actions,)), {},
    )  # fmt: skip
    assert {kind.name for kind in verify_plan(make.timed(document)).kinds()} == kinds


def test_a_verdict_says_how_near_it_came(make):
    """Towers 15 mm apart, the second printed beside the first: the head reaches 7 mm."""
    nearest = verify_plan(make.tower_plan(towers=((20.0, 20.0), (35.0, 20.0)))).nearest
    assert nearest.heads is None
    assert nearest.beside is not None
    assert nearest.beside.mm == pytest.approx(15.0 - 4.0 - 7.0 - 0.2)
    assert not nearest.beside.at_least
    assert nearest.beside.at[0].endswith("(slice at 0 mm)")
    assert nearest.beside.at[1].startswith("contour ")
    far = verify_plan(make.tower_plan()).nearest.beside
    assert (far.mm, far.at_least, far.at) == (5.0, True, ())


def test_a_verdict_says_how_near_two_heads_come(make):
    """Their bodies are 20 mm wide and the rail keeps the nozzles apart."""
    plan = make.two_head_plan()
    heads = verify_plan(plan).nearest.heads
    assert heads is not None
    assert heads.heads == ("left", "right")
    assert heads.mm >= heads.required_mm == plan.machine.head_clearance_mm
    assert not heads.at_least
    for head, words in zip(heads.heads, heads.at, strict=True):
        assert f"head {head} " in words


def test_a_plan_that_meets_the_print_states_no_room_beside_it(make):
    """There is none."""
    verdict = verify_plan(make.tower_plan(towers=((20.0, 20.0), (26.0, 20.0))))
    assert verdict.nearest.beside is None
