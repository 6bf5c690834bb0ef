"""Edges of every kind are found anew: a plan cannot leave out what it would rather not keep."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from decmcts.feasibility.build import build_graph, closure_of
from decmcts.feasibility.rules import limit_lead
from decmcts.print.contours import Role
from decmcts.print.job import PrintJob
from decmcts.print.plan import JointPlan, OrderRules
from sim.faults import FaultKind as K
from sim.verify import verify_plan

FREE = OrderRules("free", quality=False)
KEEP = OrderRules("keep", quality=False)
QUALITY = OrderRules("free", quality=True)


def strokes(make, roles, *, order=None, gap=0.4, layers=1, freedom="seam", tower=False):
    """One head draws lines side by side, `gap` apart, one role each, in some order."""
    n = len(roles)
    paths = [
        np.array([[20.0, 20.0 + gap * k, 0.2 * (j + 1)], [30.0, 20.0 + gap * k, 0.2 * (j + 1)]])
        for j in range(layers)
        for k in range(n)
    ]
    machine = make.one_head_machine(half=0.1)
    order = range(n * layers) if order is None else order
    z = 0.2 * layers + 1.0
    actions = make.head_actions(
        machine.heads[0], [(c, False) for c in order], paths, 0, clearance_z=z
    )
    base = make.tower_plan()
    contours = replace(make.contours_of(paths), role=np.tile(np.array(roles, np.int8), layers))
    none = np.empty((0, 2), np.int32)
    return replace(
        base, machine=machine, contours=contours, precedence=none, plan=JointPlan((actions,))
    )


P, EXT, INF, IRON, TOP, SUP = (
    Role.PERIMETER, Role.EXTERNAL_PERIMETER, Role.INFILL, Role.IRONING, Role.TOP_SOLID_INFILL,
    Role.SUPPORT,
)  # fmt: skip


@pytest.mark.parametrize(
    ("roles", "rules", "due"),
    [
        ((P, INF), KEEP, True),
        ((INF, P), KEEP, True),
        ((INF, SUP), KEEP, True),
        ((P, P), KEEP, False),
        ((P, INF), FREE, False),
        ((P, INF), QUALITY, True),
        ((INF, P), QUALITY, False),
        ((P, EXT), QUALITY, True),
        ((P, P), QUALITY, True),
        ((INF, SUP), QUALITY, False),
        ((TOP, IRON), QUALITY, True),
        ((IRON, TOP), QUALITY, False),
        ((0, 0), QUALITY, True),
        ((0, 0), KEEP, False),
    ],
)
def test_roles_that_touch_keep_their_order(make, roles, rules, due):
    """With the pairs emptied the swap is found, exactly where the definition has an edge."""
    assert verify_plan(strokes(make, roles), rules=rules).ok
    swapped = verify_plan(strokes(make, roles, order=(1, 0)), rules=rules)
    assert swapped.kinds() - {K.PRIMING} == ({K.PRECEDENCE} if due else set())


@pytest.mark.parametrize(("gap", "due"), [(0.449, True), (0.451, False)])
def test_touching_is_half_the_widths_and_a_twentieth(make, gap, due):
    """Beads of 0.4 mm touch up to 0.45 mm apart."""
    verdict = verify_plan(strokes(make, (P, INF), order=(1, 0), gap=gap), rules=KEEP)
    assert verdict.ok != due


def test_what_a_plan_says_of_itself(make):
    """Its own rules count, the usual ones where it has none, and those asked for before both."""
    plan = strokes(make, (P, INF), order=(1, 0))
    assert verify_plan(plan).kinds() == {K.PRECEDENCE}
    assert verify_plan(replace(plan, rules=FREE)).ok
    assert verify_plan(replace(plan, rules=FREE), rules=KEEP).kinds() == {K.PRECEDENCE}
    said = [verify_plan(replace(plan, rules=r), rules=i).checked[0] for r, i in
            ((None, None), (FREE, None), (FREE, KEEP))]  # fmt: skip
    assert "keep" in said[0] and "the defaults" in said[0]
    assert "free" in said[1] and "as the plan says" in said[1]
    assert "keep" in said[2] and "as asked" in said[2]


def test_roles_are_the_sources(make):
    """A plan that calls everything infill is compared with its source and held to that."""
    plan = strokes(make, (P, INF), order=(1, 0))
    source = PrintJob("source", plan.contours)
    lying = replace(plan, contours=replace(plan.contours, role=np.full(2, INF, np.int8)))
    assert verify_plan(lying, rules=KEEP).ok
    assert verify_plan(lying, rules=KEEP, source=source).kinds() == {K.CONTOUR, K.PRECEDENCE}


@pytest.mark.parametrize("field", ["width", "height", "role", "closed", "layer", "tool",
                                   "reversible", "epoch", "line"])  # fmt: skip
def test_every_field_of_a_contour_is_compared(make, field):
    """What the judge takes from the plan must be what the source has."""
    plan = strokes(make, (P, INF))
    value = getattr(plan.contours, field).copy()
    value[1] = not value[1] if value.dtype == np.bool_ else value[1] + 1
    source = PrintJob("source", replace(plan.contours, **{field: value}))
    verdict = verify_plan(plan, source=source, rules=FREE)
    assert any(f.kind == K.CONTOUR and field in f.text for f in verdict.faults)


def test_numbers_of_contours_are_compared(make):
    """The same lines under other numbers are another order of the source."""
    plan = strokes(make, (P, P))
    points = plan.contours.points.reshape(2, 2, 3)[::-1].reshape(4, 3)
    source = PrintJob("source", replace(plan.contours, points=points))
    assert verify_plan(plan, source=source, rules=FREE).kinds() == {K.CONTOUR}


@pytest.mark.parametrize(("ahead", "due"), [(0, True), (1, True), (2, False), (None, False)])
def test_layers_ahead(make, ahead, due):
    """Three lines of one stack before the first of the other: two layers ahead."""
    plan = strokes(make, (P, P), order=(0, 2, 4, 1, 3, 5), gap=9.0, layers=3)
    rules = replace(FREE, max_layers_ahead=ahead)
    assert verify_plan(plan, rules=rules).kinds() == ({K.PRECEDENCE} if due else set())


def test_objects_one_by_one_climb_anew(make):
    """Where the source goes down again, the limit holds within each climb."""
    plan = strokes(make, (P, P), gap=9.0, layers=3)
    by_object = np.array([0, 2, 4, 1, 3, 5])
    paths = [plan.contours.polyline(int(c)) for c in by_object]
    actions = make.head_actions(
        plan.machine.heads[0], [(c, False) for c in range(6)], paths, 0, clearance_z=1.6
    )
    plan = replace(plan, contours=make.contours_of(paths), plan=JointPlan((actions,)))
    assert verify_plan(plan, rules=replace(FREE, max_layers_ahead=0)).ok


@pytest.mark.parametrize(
    ("freedom", "due"), [("fixed", {K.WRONG_PATH}), ("reversible", set()), ("seam", set())]
)
def test_freedom(make, freedom, due):
    """A contour that is reversed was not asked for with freedom `fixed`."""
    plan = strokes(make, (P, P))

    def reverse(rows):
        rows[1]["path"], rows[1]["reversed"] = rows[1]["path"][::-1].copy(), True
        rows[0]["path"][-1] = rows[1]["path"][0]
        rows[0]["path"][-2, :2] = rows[1]["path"][0, :2]
        rows[2]["path"][0] = rows[1]["path"][-1]
        rows[2]["path"][1, :2] = rows[1]["path"][-1, :2]

    edited = make.edited(plan, 0, reverse)
    assert verify_plan(edited, rules=replace(FREE, freedom=freedom)).kinds() == due


@pytest.mark.slow
@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_against_the_planners_graph(make, data):
    """Any order: a fault of this kind exactly where the planner's closure is broken."""
    roles = data.draw(
        st.lists(st.sampled_from([P, EXT, INF, IRON, SUP, 0]), min_size=2, max_size=4)
    )
    order = data.draw(st.permutations(range(2 * len(roles))))
    keep = data.draw(st.sampled_from(["keep", "free"]))
    quality, ahead = data.draw(st.booleans()), data.draw(st.sampled_from([None, 0, 1]))
    plan = strokes(make, tuple(roles), order=order, layers=2)
    rules = OrderRules(keep, quality, ahead)
    graph = build_graph(
        plan.contours, plan.machine.heads, clearance_mm=0.0, process_order=keep, quality=quality
    )
    if ahead is not None:
        graph = limit_lead(graph, plan.contours.layer, layers=ahead)
    bits = closure_of(graph)
    rank = {c: k for k, c in enumerate(order)}
    n = len(order)
    broken = any(
        bits[b, 0] >> np.uint64(a) & np.uint64(1) and rank[a] > rank[b]
        for b in range(n)
        for a in range(b)
    )
    faults = verify_plan(plan, rules=rules).kinds() & {K.PRECEDENCE, K.HEAD_MATERIAL}
    assert bool(faults) == broken
