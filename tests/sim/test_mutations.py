"""The judge can fail a plan: each kind of fault is put into a good plan and must be found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from decmcts.print.job import PrintJob
from decmcts.print.machine import Rail
from decmcts.print.plan import JointPlan
from sim.faults import FaultKind as K
from sim.verify import verify_plan


def kinds(document, **options) -> set[K]:
    return verify_plan(document, **options).kinds()


def swap_layers(rows):
    rows[1]["contour"], rows[5]["contour"] = rows[5]["contour"], rows[1]["contour"]
    rows[1]["path"], rows[5]["path"] = rows[5]["path"], rows[1]["path"]
    rows[0]["path"][-1], rows[2]["path"][0] = rows[1]["path"][0], rows[1]["path"][-1]
    rows[4]["path"][-1], rows[6]["path"][0] = rows[5]["path"][0], rows[5]["path"][-1]


def drop(rows):
    rows[4]["path"] = np.vstack([rows[2]["path"][:1], rows[4]["path"]])
    return rows[:2] + rows[4:]


def double(rows):
    now = {"begin_s": rows[1]["end_s"], "end_s": rows[1]["end_s"] + 4e-4}
    back = {**rows[2], "path": rows[0]["path"][-1:], **now}
    return [*rows[:2], back, {**rows[1], **now}, *rows[2:]]


def shift_print(rows):
    rows[3]["path"][1, 0] += 0.02


def jump(rows):
    rows[4]["path"][0, 0] += 0.5


def reverse_without_saying(rows):
    rows[3]["path"] = rows[3]["path"][::-1].copy()


def wrong_entry(rows):
    rows[3]["entry"] = 2


def not_home_at_end(rows):
    rows[-1]["path"][-1, 1] += 1.0


def not_home_at_start(rows):
    rows[0]["path"][0, 1] += 1.0


def lower_travel(rows):
    """The travel to the second tower stays low and crosses the first."""
    travel = next(r for r in rows[::-1] if r["kind"].name == "TRAVEL" and r["path"][0, 2] == 1.0)
    start, goal = travel["path"][0], travel["path"][-1]
    travel["path"] = np.array([start, [start[0] + 2, start[1] + 2, 0.3], goal])


def wait_for_oneself(rows):
    rows[2]["after"] = [(0, 5)]


ONE_HEAD = [
    (swap_layers, {K.PRECEDENCE, K.HEAD_MATERIAL}),
    (drop, {K.MISSING}),
    (double, {K.DOUBLED, K.TIMES}),
    (shift_print, {K.WRONG_PATH}),
    (jump, {K.WRONG_PATH}),
    (wrong_entry, {K.WRONG_PATH}),
    (not_home_at_end, {K.NOT_PARKED}),
    (not_home_at_start, {K.NOT_PARKED}),
    (lower_travel, {K.HEAD_MATERIAL}),
    (wait_for_oneself, {K.DEADLOCK}),
]


@pytest.mark.parametrize(("change", "due"), ONE_HEAD, ids=lambda v: getattr(v, "__name__", ""))
def test_a_spoiled_one_head_plan_is_found(make, change, due):
    """Exactly the kinds of the seeded fault are reported, no more and no fewer."""
    assert kinds(make.edited(make.tower_plan(), 0, change)) == due


def test_a_reversed_contour_needs_to_say_so(make):
    """An open contour run from its other end without `reversed` leaves its polyline."""
    document = make.tower_plan()
    contours = replace(document.contours, points=document.contours.points.copy())
    assert kinds(make.edited(replace(document, contours=contours), 0, reverse_without_saying)) == {
        K.WRONG_PATH
    }


def test_a_contour_the_source_forbids_to_reverse(make):
    """Wipes and ramps only work one way; reversing one is a fault although the path is right."""
    document = make.tower_plan()
    contours = replace(document.contours, reversible=np.zeros(len(document.contours), bool))

    def reverse(rows):
        rows[3]["path"], rows[3]["reversed"] = rows[3]["path"][::-1].copy(), True

    assert kinds(make.edited(replace(document, contours=contours), 0, reverse)) == {K.WRONG_PATH}


def test_out_of_reach(make):
    """A head that cannot get there must not be sent there."""
    document = make.tower_plan()
    head = replace(document.machine.heads[0], reach_min=(0.0,) * 3, reach_max=(62.0, 200.0, 50.0))
    machine = replace(document.machine, heads=(head,))
    assert kinds(replace(document, machine=machine)) == {K.OUT_OF_REACH}


def test_wrong_material(make):
    """A head prints only what its tools can."""
    document = make.tower_plan()
    head = replace(document.machine.heads[0], tools=(1, 2))
    assert kinds(replace(document, machine=replace(document.machine, heads=(head,)))) == {
        K.INELIGIBLE
    }


def test_unknown_head(make):
    """A plan for another machine is refused before anything else is judged."""
    document = make.tower_plan()
    all_actions = (replace(document.plan.heads[0], head="other"),)
    assert kinds(replace(document, plan=JointPlan(all_actions))) == {K.MACHINE}


def test_without_the_after_the_heads_meet(make):
    """The right head must wait until the left one has parked; nothing else keeps them apart."""

    def forget(rows):
        for row in rows:
            row["after"] = []

    for rail, due in ((True, {K.HEAD_HEAD, K.RAIL}), (False, {K.HEAD_HEAD})):
        assert kinds(make.edited(make.two_head_plan(rail=rail), 1, forget)) == due


def test_every_rail_is_judged(make):
    """A plan that keeps the first of two rails may still break the second."""
    document = make.two_head_plan()
    across = Rail(1, ("left", "right"), 25.0)  # both heads work at the same y
    machine = replace(document.machine, rails=(*document.machine.rails, across))
    verdict = verify_plan(replace(document, machine=machine))
    assert verdict.kinds() == {K.RAIL}
    assert any("may happen together" in f.text and "along y" in f.text for f in verdict.faults)
    assert any(f.text.startswith("replay") for f in verdict.faults)


def test_after_too_early_an_action_is_a_fault(make):
    """Waiting for the last print but not for the retreat leaves the left head in the way."""

    def early(rows):
        for row in rows:
            row["after"] = [edge._replace(action=edge.action - 1) for edge in row["after"]]

    assert K.HEAD_HEAD in kinds(make.edited(make.two_head_plan(), 1, early))


def test_a_clash_that_nominal_timing_hides(make):
    """No replay at nominal speed meets; only the exact check of all timings sees it."""
    document = make.edited(
        make.two_head_plan(rail=False), 1, lambda rows: [{**r, "after": []} for r in rows]
    )
    feed = document.contours.feed.copy()
    slow = document.contours.offsets[4], document.contours.offsets[8]
    feed[slow[0] : slow[1]] /= 20.0  # the right head is busy until the left one is home
    document = make.timed(replace(document, contours=replace(document.contours, feed=feed)))
    verdict = verify_plan(document, trials=0)
    assert verdict.kinds() == {K.HEAD_HEAD}
    assert not any("nominal" in fault.text for fault in verdict.faults)


def test_heads_parked_into_each_other(make):
    """Two parks too near are a fault though no head ever moves there."""
    document = make.two_head_plan(meet=False)
    left, right = document.machine.heads
    idle = replace(right, name="third", park=(left.park[0], left.park[1] + 15.0, left.park[2]))
    machine = replace(document.machine, heads=(left, right, idle), rails=())
    assert kinds(replace(document, machine=machine)) == {K.HEAD_HEAD}


def test_cross_head_precedence_needs_an_after(make):
    """A pair across heads holds only through `after`, whatever the nominal times say."""
    document = make.two_head_plan(meet=False)
    pairs = np.vstack([document.precedence, [[0, 7]]]).astype(np.int32)
    assert kinds(replace(document, precedence=pairs)) == {K.PRECEDENCE}

    def wait(rows):
        rows[-3]["after"] = [(0, 1)]

    assert kinds(make.edited(replace(document, precedence=pairs), 1, wait)) == set()


def test_a_barrier_holds_without_any_pair(make):
    """What no contour may be moved across is checked from the epochs, not from the plan's pairs."""
    document = make.two_head_plan(meet=False)
    epoch = np.zeros(8, np.int32)
    epoch[[2, 3, 7]] = 1  # left prints 0..3, right 4..7
    document = replace(document, contours=replace(document.contours, epoch=epoch))
    assert kinds(document) == {K.PRECEDENCE}

    def wait_for(other, action, at):
        def change(rows):
            rows[at]["after"] = [(other, action)]
            rows[at:] = [
                {**row, "begin_s": row["begin_s"] + 9, "end_s": row["end_s"] + 9}
                for row in rows[at:]
            ]

        return change

    document = make.edited(document, 0, wait_for(1, 5, 4))
    assert kinds(document) == {K.PRECEDENCE}
    assert kinds(make.edited(document, 1, wait_for(0, 3, 6))) == set()


def test_two_heads_waiting_for_each_other(make):
    """A cycle through both heads never ends; it is named, not run into."""
    document = make.two_head_plan(meet=False)

    def wait_for(other, action):
        def change(rows):
            rows[0]["after"] = [(other, action)]

        return change

    document = make.edited(document, 0, wait_for(1, 3))
    assert kinds(make.edited(document, 1, wait_for(0, 3))) == {K.DEADLOCK}


def test_times_that_break_the_order(make):
    """Nominal times are what others draw and print; they must keep the order too."""

    def hurry(rows):
        for row in rows:
            if row["after"]:
                row["begin_s"] = row["end_s"] = 0.0

    assert K.TIMES in kinds(make.edited(make.two_head_plan(), 1, hurry))


def moved_in_part(points):
    return points + 0.05 * (np.arange(len(points)) < 9)[:, None]


@pytest.mark.parametrize(
    ("field", "change", "due"),
    [
        ("extrusion", lambda v: v * 1.01, {K.CONTOUR, K.EXTRUSION, K.E_TOTAL}),
        ("feed", lambda v: v + 1.0, {K.CONTOUR, K.FEED}),
        ("points", lambda v: v + np.array([0.0, 0.0, 0.05]), {K.OTHER_PRINT}),
        ("points", moved_in_part, {K.CONTOUR, K.MISSING, K.EXTRUSION}),
    ],
)
def test_the_source_is_compared(make, field, change, due):
    """A plan that fits itself but not its source is no plan for it."""
    document = make.tower_plan()
    contours = document.contours
    source = replace(contours, **{field: change(getattr(contours, field))})
    assert kinds(document, source=PrintJob("source", source)) == due


def test_the_digest_is_compared(make):
    """The plan of another problem is refused by name."""
    assert kinds(make.tower_plan(), digest="another") == {K.DIGEST}


@pytest.mark.slow
@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(order=st.permutations(range(6)), data=st.data())
def test_random_orders_against_brute_force(make, order, data):
    """Any order of two near towers: contact is found exactly where a plain loop finds it."""
    gap = data.draw(st.sampled_from([5.0, 8.0, 11.0, 11.5, 13.0]))
    layers, side, half = 3, 4.0, 7.0
    places = ((20.0, 20.0), (20.0 + side + gap, 20.0))
    base = make.tower_plan(layers=layers, towers=places, half=half)
    paths = [base.contours.polyline(c) for c in range(6)]
    actions = make.head_actions(
        base.machine.heads[0], [(c, False) for c in order], paths, 0, clearance_z=0.8
    )
    document = replace(base, plan=JointPlan((actions,)), precedence=np.empty((0, 2), np.int32))
    near = gap < half + 0.2 - 1e-3
    rank = {c: k for k, c in enumerate(order)}
    blocked = any(
        rank[q] < rank[p]
        for p in range(6)
        for q in range(6)
        if q // 2 > p // 2 and (q % 2 == p % 2 or near)
    )
    assert kinds(document) == ({K.HEAD_MATERIAL} if blocked else set())
