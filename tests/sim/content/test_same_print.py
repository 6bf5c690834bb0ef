"""The machine that was named is the one a plan is for, field by field."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.print.job import PrintJob
from decmcts.print.machine import Body, MotionLimits, Slice
from sim.content.inventory import compare, contour_segments, match_segments
from sim.content.same_print import check_machine, check_print
from sim.faults import FaultKind as K
from sim.verify import verify_plan


def head_with(**changes):
    return lambda m: replace(m, heads=(replace(m.heads[0], **changes), *m.heads[1:]))


SMALL = (Slice(0.0, (np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]]),)),)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda m: replace(m, clearance_mm=0.5), "clearance_mm"),
        (lambda m: replace(m, head_clearance_mm=0.5), "head_clearance_mm"),
        (lambda m: replace(m, bead_width=False), "bead_width"),
        (lambda m: replace(m, bed_max=(300.0, 300.0)), "bed_max"),
        (lambda m: replace(m, lift_mm=0.0), "lift_mm"),
        (lambda m: replace(m, rails=()), "rail"),
        (head_with(slices=SMALL), "head left: slices"),
        (head_with(bodies=()), "head left: bodies"),
        (head_with(bodies=(Body("beam", (-1.0, -1.0, 1.0), (1.0, 1.0, 2.0)),)), "bodies"),
        (head_with(park=(-40.0, 50.0, 30.0)), "head left: park"),
        (head_with(reach_min=(0.0, 0.0, 0.0)), "head left: reach_min"),
        (head_with(limits=MotionLimits(travel_feed=99.0)), "head left: limits"),
        (lambda m: replace(m, release="point"), "release"),
        (head_with(name="other"), "heads"),
    ],
)
def test_a_plan_for_another_machine_names_the_field(make, change, field):
    """A smaller head or clearance in the plan would pass every other check."""
    machine = make.two_head_machine()
    assert check_machine(machine, machine, None) == []
    (fault,) = check_machine(change(machine), machine, None)
    assert fault.kind == K.MACHINE
    assert fault.text.startswith(field) or field in fault.text


def test_tools_count_where_the_machine_named_has_some(make):
    """Presets name none: then `launch` was told with `--tool` what each head prints with."""
    preset = make.two_head_machine()
    ours = head_with(tools=(1,))(preset)
    assert check_machine(ours, preset, None) == []
    (fault,) = check_machine(ours, head_with(tools=(0,))(preset), None)
    assert fault.text.startswith("head left: tools")


def test_one_head_of_several_and_a_higher_park(make):
    """`plan` prints with one head, which parks above its print; both are the machine's."""
    machine = make.two_head_machine()
    left = machine.heads[0]
    lone = replace(machine, heads=(replace(left, park=(-40.0, 50.0, 99.0)),), rails=())
    assert check_machine(lone, machine, None) == []
    lower = replace(lone, heads=(replace(left, park=(-40.0, 50.0, 1.0)),))
    assert [f.kind for f in check_machine(lower, machine, None)] == [K.MACHINE]


def test_a_plan_may_ask_for_less_than_its_controllers_can_do(make):
    """Plans written before machines said what they can release wait for whole actions."""
    machine = make.two_head_machine()
    assert check_machine(machine, replace(machine, release="point"), None) == []


def test_limits_are_the_machines_or_the_sources(make):
    """A source's limits replace the machine's; others are nobody's."""
    document = make.tower_plan()
    said = replace(MotionLimits.unstated(), acceleration=900.0)
    source = PrintJob("source", document.contours, limits=said)
    machine = document.machine
    for limits, due in (
        (machine.limits, 0),
        (machine.limits.under(said), 0),
        (replace(machine.limits, acceleration=901.0), 1),
    ):
        ours = replace(machine, limits=limits)
        assert len(check_machine(ours, machine, source)) == due
        assert check_machine(ours, machine, None) == []


def test_the_verdict_says_what_was_believed(make):
    """Who reads "no fault" must see what that rests on."""
    document = make.tower_plan()
    alone = verify_plan(document).checked
    assert any("as the plan has it" in line for line in alone)
    assert any("no source was given" in line for line in alone)
    source = PrintJob("source", document.contours)
    both = verify_plan(document, source=source, machine=document.machine).checked
    assert any("compared with the source in all fields" in line for line in both)
    other = replace(document.machine, clearance_mm=0.1)
    assert verify_plan(document, machine=other).kinds() == {K.MACHINE}


def rows_of_lines(n: int, x: float) -> list[np.ndarray]:
    """Contours of one segment each, beside one another from `x` on."""
    return [np.array([[x + k, 10.0, 0.2], [x + k, 20.0, 0.2]]) for k in range(n)]


def test_another_print_is_said_in_one_line(make):
    """Dozens of segments that are missing tell nobody that the wrong file was named."""
    ours, source = (contour_segments(make.contours_of(rows_of_lines(30, x))) for x in (10, 38))
    match = match_segments(ours, source)
    (fault,) = check_print(ours, source, match, source.place)
    assert str(fault).startswith(
        "another print, or the same one moved: 2 of the source's 30 contours and 2 of its 30"
    )


@pytest.mark.parametrize("kept", [3, 29])
def test_a_part_of_the_print_is_no_other_print(make, kept):
    """Of the right print each fault is named, however much of it is gone."""
    rows = rows_of_lines(30, 10)
    ours, source = (contour_segments(make.contours_of(r)) for r in (rows[:25] + rows[28:], rows))
    few = rows[:kept] + rows_of_lines(30 - kept, 50)
    altered = contour_segments(make.contours_of(few))
    for found in (ours, altered):
        match = match_segments(found, source)
        assert check_print(found, source, match, source.place) == []
        assert compare(found, source, match)


def test_a_short_print_is_compared_segment_by_segment(make):
    """Its faults can all be read; one altered line of one is no other print."""
    ours, source = (contour_segments(make.contours_of(rows_of_lines(5, x))) for x in (10, 50))
    match = match_segments(ours, source)
    assert check_print(ours, source, match, source.place) == []
    assert compare(ours, source, match)
