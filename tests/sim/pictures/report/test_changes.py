"""What differs between two plans: travels, walls crossed, who prints what when."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shapely import LineString, Point, union_all

from decmcts.print.contours import Role
from decmcts.print.plan import ActionKind, JointPlan
from sim.content.over_walls import over_walls_mm
from sim.pictures.layer_travels import by_layer, most_changed, travels_of
from sim.pictures.report.data import (
    CROSSED,
    MOVED,
    OTHER,
    OVER_WALL,
    flags_of,
    saving_of,
    travel_lengths,
)


def reordered(make, order):
    """The towers' plan with its contours in another order."""
    document = make.tower_plan()
    paths = [document.contours.polyline(c) for c in range(len(document.contours))]
    actions = make.head_actions(
        document.machine.heads[0], [(c, False) for c in order], paths, 0, clearance_z=1.2
    )
    return replace(document, plan=JointPlan((actions,)))


def test_equal_plans_have_no_changes(make):
    """Nothing may be lit up where nothing changed."""
    document = make.tower_plan()
    for flags in flags_of(document, document):
        assert not (flags[0] & (OTHER | MOVED)).any()


def test_a_travel_run_the_other_way_is_no_change(make):
    """Between the same two places the nozzle goes over the same spots."""
    before = reordered(make, [0, 2, 4, 6, 8, 1, 3, 5, 7, 9])
    after = reordered(make, [1, 3, 5, 7, 9, 0, 2, 4, 6, 8])
    gone, new = (flags[0] & OTHER > 0 for flags in flags_of(before, after))
    heads = [document.plan.heads[0] for document in (before, after)]
    for flags, actions in zip((gone, new), heads, strict=True):
        travels = np.flatnonzero(actions.kind == ActionKind.TRAVEL)
        changed = flags[travels].nonzero()[0].tolist()
        assert changed == [0, 5]  # from the park, and between the towers: from another layer


def test_what_is_printed_much_later_has_moved(make):
    """Half of the order away is much, the same place is not."""
    before, after = make.tower_plan(), reordered(make, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9])
    for document, flags in zip((before, after), flags_of(before, after), strict=True):
        actions = document.plan.heads[0]
        moved = flags[0] & MOVED > 0
        printed = actions.contour[moved & (actions.kind == ActionKind.PRINT)]
        assert set(printed.tolist()) == {2, 4, 6, 8, 1, 3, 5, 7}


def test_what_another_head_prints_has_moved(make):
    """Even at the same time of the print."""
    before = make.timed(make.two_head_plan())
    swapped = JointPlan(before.plan.heads[::-1])
    flags = flags_of(before, replace(before, plan=swapped))[1]
    for actions, marks in zip(swapped.heads, flags, strict=True):
        assert (marks[actions.kind == ActionKind.PRINT] & MOVED > 0).all()


@pytest.mark.parametrize("role", [Role.EXTERNAL_PERIMETER, Role.INFILL])
def test_travels_over_walls_are_those_the_judge_counts(make, role):
    """By the planner's walls here, by lines of its own there."""
    document = reordered(make, list(range(10)))
    roles = np.full(len(document.contours), int(role), np.int8)
    document = replace(document, contours=replace(document.contours, role=roles))
    actions = document.plan.heads[0]
    flags = flags_of(document, document)[1][0]
    over = (flags & OVER_WALL > 0).nonzero()[0]
    judged = over_walls_mm(document.contours, actions)
    assert (len(over) > 0) == (judged > 0.0) == (role == Role.EXTERNAL_PERIMETER)


@pytest.mark.parametrize("name", ["tower_plan", "two_head_plan"])
def test_the_saving_adds_up_to_all_travel(make, name):
    """By layer all but the way to the park, by length all."""
    document = getattr(make, name)()
    saving = saving_of(document, document)
    mm = [travel_lengths(actions) for actions in document.plan.heads]
    whole = sum(float(m.sum()) for m in mm)
    parks = sum(float(m[-1]) for m in mm)
    rows = len(document.contours) // len(saving["by_layer"]["layer"])
    assert sum(saving["by_length"]["after_mm"]) == pytest.approx(whole, abs=1.0)
    assert sum(saving["by_layer"]["after"]) == pytest.approx(whole - parks, abs=1.0 + rows)
    assert sum(saving["by_length"]["before"]) == sum(map(len, mm))


def test_the_layer_that_changed_most_is_the_picture_s(make):
    """A plan that travels more is shown by what it adds: report and picture show one layer."""
    before, after = reordered(make, [0, 2, 4, 6, 8, 1, 3, 5, 7, 9]), reordered(make, range(10))
    found = {}
    for was, now in ((before, after), (after, before)):
        lengths = [by_layer(travels_of(document), 5) for document in (was, now)]
        found[was is before] = saving_of(was, now)["most_changed"]
        assert found[was is before] == most_changed(*lengths)
    assert found[True] == found[False] == int(np.argmax(lengths[0] - lengths[1]))


@pytest.mark.parametrize("role", [Role.EXTERNAL_PERIMETER, Role.INFILL])
def test_the_walls_that_are_crossed_are_named(make, role):
    """Each wall met by a travel of its layer, found here by trying all pairs."""
    document = reordered(make, [0, 3, 2, 1, 4, 6, 5, 8, 7, 9])
    roles = np.full(len(document.contours), int(role), np.int8)
    document = replace(document, contours=replace(document.contours, role=roles))
    (actions,) = document.plan.heads
    expected = set()
    for action in np.flatnonzero(actions.kind != ActionKind.PRINT).tolist():
        path = actions.action_path(action)
        way = LineString(path[:, :2])
        ends = [Point(end).buffer(0.051) for end in path[[0, -1], :2]]
        for contour in range(len(document.contours)):
            line = document.contours.polyline(contour)
            level = np.abs(path[[0, -1], 2] - line[0, 2]).min() < 1e-6
            if level and LineString(line[:, :2]).intersects(way.difference(union_all(ends))):
                expected.add(contour)
    flags = flags_of(document, document)[1][0]
    found = actions.contour[flags & CROSSED > 0].tolist()
    assert set(found) == (expected if role == Role.EXTERNAL_PERIMETER else set())
    assert len(expected) > 3
