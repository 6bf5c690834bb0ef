"""Two towers that must cool: what is due, orders that give it, waits in the plan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.feasibility.build import build_graph
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob, ProcessSettings
from decmcts.print.lags_kernels import Lags
from decmcts.print.machine import Head, Machine, Slice
from decmcts.print.plan import ActionKind, JointPlan, PlanDocument
from decmcts.print.toolpath import Toolpath
from decmcts.team.schedule.cooling import cooled, find_lags, print_times, source_times
from decmcts.team.schedule.joint_plan import schedule
from decmcts.team.schedule.timing import action_times
from decmcts.team.schedule.waits import LEAST_WAIT_S, LIFT_MM, add_waits
from sim.faults import FaultKind
from sim.verify import verify_plan

LAYERS, LAYER, SIDE = 6, 0.2, 8.0
SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]) * SIDE


def make(places: list[float], *, feed: float = 20.0) -> tuple[PrintJob, Machine, DependencyGraph]:
    """Square towers at these x, layer by layer, 32 mm a layer of each."""
    lines = [
        np.column_stack([SQUARE + np.array([x, 20.0]), np.full(5, LAYER * (k + 1))])
        for k in range(LAYERS)
        for x in places
    ]
    n, size = len(lines), len(SQUARE)
    contours = Contours(
        points=np.concatenate(lines),
        offsets=size * np.arange(n + 1, dtype=np.int64),
        extrusion=np.tile([0.0, 0.3, 0.3, 0.3, 0.3], n),
        feed=np.tile([0.0, feed, feed, feed, feed], n),
        width=np.full(n, 0.45),
        height=np.full(n, LAYER),
        role=np.ones(n, np.int8),
        closed=np.ones(n, np.bool_),
        layer=np.repeat(np.arange(LAYERS, dtype=np.int32), len(places)),
        tool=np.zeros(n, np.int16),
        reversible=np.ones(n, np.bool_),
        epoch=np.zeros(n, np.int32),
        line=np.zeros(n, np.int32),
    )
    box = np.array([[-4.0, -4.0], [4.0, -4.0], [4.0, 4.0], [-4.0, 4.0]])
    head = Head("head", (Slice(0.0, (box,)),), park=(0.0, 0.0, 20.0))
    machine = Machine("small", (0.0, 0.0), (200.0, 200.0), (head,))
    settings = ProcessSettings(travel_feed=150.0, retract_mm=0.8)
    graph = build_graph(contours, machine.heads, clearance_mm=machine.clearance_mm)
    return PrintJob("towers", contours, settings), machine, graph


def towers_first(n: int) -> Toolpath:
    """One tower after the other, for two of them."""
    order = np.concatenate([np.arange(0, n, 2), np.arange(1, n, 2)])
    return Toolpath.of(order.astype(np.int32), np.zeros(n, np.bool_))


def plan_of(job, machine, graph, toolpath) -> JointPlan:
    return schedule(job, machine, graph, [toolpath])


def lags_of(job, machine, graph, rule: float) -> Lags:
    """What is due by the times of the plan."""
    n = len(job.contours)
    plan = plan_of(job, machine, graph, Toolpath.as_sliced(n))
    (lags,) = find_lags(job.contours, [print_times(plan.heads[0], n)], rule)
    return lags


def guessed(job, machine, graph, rule: float) -> Lags:
    """What is due by the times a search estimates."""
    (lags,) = find_lags(job.contours, [source_times(job, machine, graph)], rule)
    return lags


def gaps(plan: JointPlan, lags: Lags, n: int) -> np.ndarray:
    """How long each pair of the lags really has in a plan, less what is due."""
    begin, end = print_times(plan.heads[0], n)
    above = np.repeat(np.arange(n), np.diff(lags.offsets))
    return begin[above] - end[lags.below] - lags.seconds


def test_lags_are_the_rule_or_what_the_source_gives() -> None:
    """More than the source gives a spot is never due: its layers were sliced to be long enough."""
    job, machine, graph = make([20.0, 120.0])
    short, long = (lags_of(job, machine, graph, rule) for rule in (1.0, 60.0))
    n = len(job.contours)
    above = np.repeat(np.arange(n), np.diff(short.offsets))
    assert [(int(a), int(b)) for a, b in zip(short.below, above, strict=True)] == [
        (b - 2, b) for b in range(2, n)
    ]
    assert (short.seconds == 1.0).all()
    begin, end = print_times(plan_of(job, machine, graph, Toolpath.as_sliced(n)).heads[0], n)
    np.testing.assert_allclose(long.seconds, begin[2:] - end[:-2])
    assert not len(lags_of(job, machine, graph, 0.0).below)


def test_only_the_last_of_what_is_under_a_contour_counts() -> None:
    """A wall over wall and infill owes the wall no more than the infill's little lag."""
    job, machine, graph = make([20.0, 20.2])  # the two loops of a layer lie on each other
    lags = lags_of(job, machine, graph, 60.0)
    for b in range(4, len(job.contours)):
        due = lags.seconds[lags.offsets[b] : lags.offsets[b + 1]]
        assert len(set(np.round(due, 9).tolist())) == 1
    begin, end = print_times(
        plan_of(job, machine, graph, Toolpath.as_sliced(len(job.contours))).heads[0],
        len(job.contours),
    )
    last = lags.offsets[5]  # contour 5 runs over 2 and 3; 4 lies between
    assert lags.seconds[last] == pytest.approx(begin[5] - end[3])


def test_beside_is_not_below() -> None:
    """Only what a bead runs over is warm under it; one layer further down is covered already."""
    job, machine, graph = make([20.0, 28.5])  # sides half a millimetre apart
    lags = lags_of(job, machine, graph, 5.0)
    above = np.repeat(np.arange(len(job.contours)), np.diff(lags.offsets))
    assert set((above - lags.below).tolist()) == {2}


@pytest.mark.parametrize("thick", [1.0, 2.0])
@pytest.mark.parametrize("aside", [0.0, 0.225])
@pytest.mark.parametrize("layer", [0.1, 0.15, 0.2, 0.3])
def test_ties_of_height_and_distance_count_as_under(layer, aside, thick) -> None:
    """Half a bead's height, half its width: rounding must not part planner and judge.

    Slicers print bridges of twice the layer's height; they too lie on what is under them.
    """
    job, machine, graph = make([20.0, 120.0])
    contours = job.contours
    points, which = contours.points.copy(), np.repeat(np.arange(len(contours)), 5)
    points[:, 2] = layer * (contours.layer[which] + 1)
    points[:, 0] += aside * (contours.layer[which] % 2)
    height = np.where(contours.layer % 3 == 2, thick * layer, layer)
    job = replace(job, contours=replace(contours, points=points, height=height))
    above = np.repeat(np.arange(len(contours)), np.diff(lags_of(job, machine, graph, 5.0).offsets))
    below = lags_of(job, machine, graph, 5.0).below
    pairs = set(zip(below.tolist(), above.tolist(), strict=True))
    assert {(b - 2, b) for b in range(2, len(contours))} <= pairs
    assert {b - a for a, b in pairs} <= ({2, 4} if thick > 1.0 else {2})
    sliced = plan_of(job, machine, graph, Toolpath.as_sliced(len(contours)))
    pairs_of_graph = graph.pairs()
    for plan, kinds in (
        (sliced, set()),
        (plan_of(job, machine, graph, towers_first(len(contours))), {FaultKind.COOLING}),
    ):
        document = PlanDocument("", machine, job.contours, pairs_of_graph, plan, {}, 5.0)
        assert verify_plan(document).kinds() == kinds


def test_a_lonely_tower_owes_itself_nothing_more_than_sliced() -> None:
    """One tower has no other work: the source itself goes on at once."""
    job, machine, graph = make([20.0])
    assert lags_of(job, machine, graph, 10.0).seconds.max(initial=0.0) < 0.5


def test_the_towers_take_turns_where_one_would_have_to_wait() -> None:
    """Printing a tower at once saves travel but the hot tip of it sags."""
    job, machine, graph = make([20.0, 120.0])
    lags = guessed(job, machine, graph, 10.0)
    n = len(job.contours)
    turns = cooled(job, machine, graph, lags, towers_first(n))
    assert turns.at_first_s > 5.0
    assert turns.waited_s < 1.0
    assert (turns.toolpath.order % 2).tolist() == [0, 1] * LAYERS
    place = np.argsort(turns.toolpath.order)
    assert (place[graph.pairs()[:, 0]] < place[graph.pairs()[:, 1]]).all()


def test_the_source_does_not_wait_by_rounding() -> None:
    """What waits decides which search goes on."""
    job, machine, graph = make([20.0, 70.3, 120.0], feed=17.3)
    lags = guessed(job, machine, graph, 60.0)
    sliced = cooled(job, machine, graph, lags, Toolpath.as_sliced(len(job.contours)))
    assert sliced.at_first_s == sliced.waited_s == 0.0


def test_without_lags_nothing_is_touched() -> None:
    """No rule, no change."""
    job, machine, graph = make([20.0, 120.0])
    lags = lags_of(job, machine, graph, 0.0)
    toolpath = towers_first(len(job.contours))
    assert cooled(job, machine, graph, lags, toolpath).toolpath.order.tolist() == (
        toolpath.order.tolist()
    )
    plan = plan_of(job, machine, graph, toolpath)
    assert add_waits(job, machine, plan, lags) is plan


def test_waits_give_every_spot_its_time() -> None:
    """A wait is off the print, retracted, and counts in the time of the print."""
    job, machine, graph = make([20.0, 120.0])
    lags = lags_of(job, machine, graph, 10.0)
    plain = plan_of(job, machine, graph, towers_first(len(job.contours)))
    assert gaps(plain, lags, len(job.contours)).min() < -1.0
    plan = add_waits(job, machine, plain, lags)
    spare = gaps(plan, lags, len(job.contours))
    assert spare.min() > -LEAST_WAIT_S
    actions = plan.heads[0]
    waits = np.flatnonzero(actions.kind == ActionKind.WAIT)
    assert len(waits) == 2 * (LAYERS - 1)
    spent = (actions.end_s - actions.begin_s)[waits]
    assert plan.makespan_s == pytest.approx(plain.makespan_s + spent.sum(), abs=4.0)
    for k in waits.tolist():
        (place,) = actions.action_path(k)
        printed = actions.action_path(k - 2)[-1]  # print, lift, wait
        assert place[2] == pytest.approx(printed[2] + LIFT_MM)
        assert (place[:2] == printed[:2]).all()
    ends = actions.path[actions.path_offsets[1:] - 1]
    assert (actions.path[actions.path_offsets[1:-1]] == ends[:-1]).all()
    assert (actions.begin_s[1:] == actions.end_s[:-1]).all()


def test_beads_beside_a_wait_begin_and_end_at_rest() -> None:
    """Without the wait the head goes on at speed, by a travel too short to be retracted."""
    job, machine, graph = make([20.0, 20.6])
    lags = lags_of(job, machine, graph, 10.0)
    plain = plan_of(job, machine, graph, Toolpath.as_sliced(len(job.contours)))
    lags = lags._replace(seconds=np.where(np.arange(len(lags.seconds)) % 2 == 1, 20.0, 0.0))
    before, actions = plain.heads[0], add_waits(job, machine, plain, lags).heads[0]
    rested = action_times(
        job, machine.limits, before.path, before.path_offsets, before.contour, before.reversed,
        before.entry, rests=True,
    ).seconds  # fmt: skip
    waits = np.flatnonzero(actions.kind == ActionKind.WAIT)
    longer = 0.0
    for k in waits.tolist():
        for beside in (k - 2, k + 2):  # print, lift, wait, travel, print
            (was,) = np.flatnonzero(before.contour == actions.contour[beside])
            took = actions.end_s[beside] - actions.begin_s[beside]
            assert took == pytest.approx(rested[was])
            longer = max(longer, took - before.end_s[was] + before.begin_s[was])
    assert longer > 1e-3


def test_a_lift_that_takes_the_time_needs_no_dwell() -> None:
    """A dwell of milliseconds cools nothing."""
    job, machine, graph = make([20.0, 120.0])
    lags = lags_of(job, machine, graph, 10.0)
    plain = plan_of(job, machine, graph, towers_first(len(job.contours)))
    left = gaps(plain, lags, len(job.contours)) + lags.seconds
    short = lags._replace(seconds=np.maximum(left + LEAST_WAIT_S + 0.01, 0.0))
    plan = add_waits(job, machine, plain, short)
    assert gaps(plan, short, len(job.contours)).min() > -LEAST_WAIT_S
    assert plan.makespan_s > plain.makespan_s
    assert ActionKind.WAIT not in plan.heads[0].kind


def test_the_source_waits_for_nothing() -> None:
    """What is due is what the source gives, so the source is always a way out."""
    job, machine, graph = make([20.0, 120.0])
    for rule in (3.0, 1000.0):
        sliced = Toolpath.as_sliced(len(job.contours))
        timed = cooled(job, machine, graph, guessed(job, machine, graph, rule), sliced)
        assert timed.waited_s < 1e-6
        lags = lags_of(job, machine, graph, rule)
        plan = plan_of(job, machine, graph, Toolpath.as_sliced(len(job.contours)))
        assert add_waits(job, machine, plan, lags).makespan_s == plan.makespan_s


def test_a_low_ceiling_bounds_the_lift() -> None:
    """A head that can not rise waits where it can be."""
    job, machine, graph = make([20.0, 120.0])
    lags = lags_of(job, machine, graph, 10.0)
    low = replace(machine.heads[0], reach_max=(200.0, 200.0, 1.5))
    plan = plan_of(job, machine, graph, towers_first(len(job.contours)))
    actions = add_waits(job, replace(machine, heads=(low,)), plan, lags).heads[0]
    waiting = np.flatnonzero(actions.kind == ActionKind.WAIT)
    assert actions.path[actions.path_offsets[waiting], 2].max() <= 1.5
    with pytest.raises(ValueError, match="one head"):
        add_waits(job, machine, JointPlan((actions, actions)), lags)
