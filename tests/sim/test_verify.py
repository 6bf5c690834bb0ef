"""Valid plans pass; the mutation tests are in test_mutations."""

from __future__ import annotations

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
