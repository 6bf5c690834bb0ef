"""Rules J1-J5 on random prints, orders and splits, against slow definitions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise, product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from shapely import LineString, MultiPoint
from shapely.affinity import translate

from decmcts.errors import InputError
from decmcts.print.motion import filament_time
from decmcts.print.plan import ACTION_END, ActionKind, JointPlan
from decmcts.print.toolpath import Toolpath
from decmcts.team.engine.alone import one_head_toolpaths
from decmcts.team.engine.space import build_space, printing_times, travel_row
from decmcts.team.engine.spaces_kernels import travel_seconds
from decmcts.team.schedule import travels
from decmcts.team.schedule.joint_plan import schedule
from tests.direct_actions import visit_points

SEEDS = range(6)


def random_split(case: Any, seed: int, *, turns: bool = False) -> list[Toolpath]:
    """A random linear extension, each contour on a random head that may print it.

    With `turns` the heads' sequences are one order of all; else who comes first goes first.
    """
    rng = np.random.default_rng(seed)
    n, graph = len(case.job.contours), case.graph
    missing = np.diff(graph.pred_offsets)
    eligible = build_space(case.job, case.machine).eligible
    ready = list(np.flatnonzero(missing == 0))
    heads: list[list[int]] = [[], []]
    turn = np.empty(n, np.int64)
    for k in range(n):
        c = int(ready.pop(int(rng.integers(len(ready)))))
        heads[int(rng.choice(np.flatnonzero(eligible[c])))].append(c)
        turn[c] = k
        for s in graph.succs[graph.succ_offsets[c] : graph.succ_offsets[c + 1]]:
            missing[s] -= 1
            if missing[s] == 0:
                ready.append(s)
    paths = [Toolpath.of(np.array(h, np.int32), rng.random(len(h)) < 0.5) for h in heads]
    return [replace(path, turn=turn[path.order]) for path in paths] if turns else paths


@pytest.fixture(scope="module", params=SEEDS)
def planned(request: pytest.FixtureRequest, case: Callable[..., Any]) -> tuple[Any, JointPlan]:
    chosen = case(request.param)
    toolpaths = random_split(chosen, request.param)
    return chosen, schedule(chosen.job, chosen.machine, chosen.graph, toolpaths)


def _printed(plan: JointPlan) -> dict[int, tuple[int, int]]:
    return {
        int(c): (r, i)
        for r, head in enumerate(plan.heads)
        for i, c in enumerate(head.contour)
        if c >= 0
    }


def _x(path: np.ndarray) -> tuple[float, float]:
    return float(path[:, 0].min()), float(path[:, 0].max())


def _clash(plan: JointPlan, left: np.ndarray, right: np.ndarray, gap: float) -> bool:
    return _x(left)[1] + gap > _x(right)[0] + 1e-6


def test_every_contour_once_and_paths_join(planned: tuple[Any, JointPlan]) -> None:
    """J1, and the nozzle never jumps: each path starts where the last one ended."""
    case, plan = planned
    contours = [int(c) for head in plan.heads for c in head.contour if c >= 0]
    assert sorted(contours) == list(range(len(case.job.contours)))
    for head, body in zip(plan.heads, case.machine.heads, strict=True):
        at = np.array(body.park)
        for i in range(len(head)):
            path = head.action_path(i)
            assert path[0] == pytest.approx(at)
            at = path[-1]
            if head.kind[i] == ActionKind.PRINT:
                want = visit_points(
                    case.job.contours, int(head.contour[i]), reversed_=bool(head.reversed[i])
                )
                assert np.array_equal(path, want)
        assert at == pytest.approx(np.array(body.park))


def test_precedence_holds_for_every_timing(
    planned: tuple[Any, JointPlan], order_oracle: Any
) -> None:
    """J2: whatever the heads' speeds, nothing is printed before what it rests on."""
    case, plan = planned
    order, where = order_oracle(plan), _printed(plan)
    for a, b in case.graph.pairs():
        assert order.before(where[int(a)], where[int(b)])


def test_conflicting_actions_are_ordered(planned: tuple[Any, JointPlan], order_oracle: Any) -> None:
    """J3: no timing error can make the heads meet, moving or resting."""
    case, plan = planned
    order, gap = order_oracle(plan), case.machine.rails[0].separation_mm
    left, right = plan.heads
    for i, j in product(range(len(left)), range(len(right))):
        p, q = left.action_path(i), right.action_path(j)
        if _clash(plan, p, q, gap):
            assert order.before((0, i), (1, j)) or order.before((1, j), (0, i))
        if _clash(plan, p[-1:], q, gap):  # left rests until its next action begins
            assert order.before((1, j), (0, i)) or order.before((0, i + 1), (1, j))
        if _clash(plan, p, q[-1:], gap):
            assert order.before((0, i), (1, j)) or order.before((1, j + 1), (0, i))


def test_travels_clear_whatever_may_be_printed(
    planned: tuple[Any, JointPlan], order_oracle: Any
) -> None:
    """J5: a travel misses all material that is not ordered after it."""
    case, plan = planned
    order, where = order_oracle(plan), _printed(plan)
    lines = [LineString(case.job.contours.polyline(c)[:, :2]) for c in range(len(where))]
    for r, head in enumerate(plan.heads):
        for i in np.flatnonzero(head.kind != ActionKind.PRINT):
            path = head.action_path(int(i))
            material = [c for c, at in where.items() if not order.before((r, int(i)), at)]
            for a, b in pairwise(path):
                for piece in case.machine.heads[r].slices:
                    shape = MultiPoint(piece.polygons[0]).convex_hull
                    swept = translate(shape, *a[:2]).union(translate(shape, *b[:2])).convex_hull
                    low = min(a[2], b[2]) + piece.height_mm + 1e-6
                    for c in material:
                        if case.job.contours.top[c] > low:
                            reach = case.job.contours.width[c] / 2 - 1e-6
                            assert swept.distance(lines[c]) > reach


def test_nominal_times_execute_the_order(planned: tuple[Any, JointPlan]) -> None:
    """Every action begins when all it waits for is over, and none later for no reason."""
    _, plan = planned
    for head in plan.heads:
        for i in range(len(head)):
            ends = [head.end_s[i - 1]] if i else [0.0]
            latest = 0.0
            for wait in head.after_edges(i):
                other = plan.heads[wait.head]
                latest = max(latest, other.end_s[wait.action])
                at_end = wait.point == ACTION_END
                ends.append((other.end_s if at_end else other.begin_s)[wait.action])
            assert max(ends) - 1e-9 <= head.begin_s[i] <= max(*ends, latest) + 1e-9


def test_few_waits(planned: tuple[Any, JointPlan]) -> None:
    """At most one wait per action and other head: controllers have few sync points."""
    _, plan = planned
    for head in plan.heads:
        assert np.diff(head.after_offsets).max(initial=0) <= 1


def test_one_head_prints_everything(case: Callable[..., Any]) -> None:
    """One head's order is a joint plan whose other head never leaves its park."""
    chosen = case(1)
    toolpaths = [Toolpath.as_sliced(len(chosen.job.contours)), Toolpath.as_sliced(0)]
    plan = schedule(chosen.job, chosen.machine, chosen.graph, toolpaths)
    assert len(plan.heads[1]) == 0
    assert plan.heads[0].contour[plan.heads[0].contour >= 0].tolist() == list(
        range(len(chosen.job.contours))
    )
    assert plan.makespan_s == plan.heads[0].end_s[-1]


def test_a_slow_head_takes_as_many_times_as_long(case: Callable[..., Any]) -> None:
    """Whatever it does; the engine that orders units reckons with it too."""
    chosen = case(0)
    left, *others = chosen.machine.heads
    slow = replace(chosen.machine, heads=(replace(left, pace=1.5), *others))
    sliced = [Toolpath.as_sliced(len(chosen.job.contours))]
    before, after = (
        schedule(chosen.job, machine.alone(machine.heads[0]), chosen.graph, sliced).heads[0]
        for machine in (chosen.machine, slow)
    )
    assert after.end_s == pytest.approx(1.5 * before.end_s)
    times = printing_times(chosen.job, chosen.machine)
    assert printing_times(chosen.job, slow) == pytest.approx(times * [[1.5], [1.0]])
    rows = [np.array(travel_row(chosen.job.settings, slow.limits, k)) for k in (1.0, 1.5)]
    for end in ((0.5, 0.0, 0.0), (90.0, 40.0, 0.0), (90.0, 40.0, 7.0)):
        fast, late = (travel_seconds((0.0, 0.0, 0.0), end, row) for row in rows)
        assert late == pytest.approx(1.5 * fast)


def test_long_travels_hop_as_the_source_does(case: Callable[..., Any]) -> None:
    """Beads curl up: a source that lifts over them knows its material."""
    chosen = case(3)
    job, machine = chosen.job, chosen.machine
    settings = replace(job.settings, hop_mm=0.4, retract_mm=1.0, retract_min_travel_mm=2.0)
    paths = one_head_toolpaths(job, machine, Toolpath.as_sliced(len(job.contours)))
    plan = schedule(replace(job, settings=settings), machine, chosen.graph, paths)
    hopped = 0
    for head in plan.heads:
        for k in np.flatnonzero(head.kind == ActionKind.TRAVEL).tolist():
            path = head.action_path(k)
            if np.linalg.norm((path[-1] - path[0])[:2]) >= 2.0:
                assert path[:, 2].max() >= path[[0, -1], 2].max() + 0.4 - 1e-9
                hopped += 1
    assert hopped > len(job.contours) // 4


def test_fresh_memory_may_hold_anything(
    case: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Levels of units that print are no travels' levels; left unset they were at times infinite."""
    spoiled = SimpleNamespace(**vars(np))
    spoiled.empty = lambda shape: np.full(shape, np.inf)
    spoiled.empty_like = lambda like: np.full_like(like, np.inf)
    monkeypatch.setattr(travels, "np", spoiled)
    chosen = case(3)
    paths = one_head_toolpaths(
        chosen.job, chosen.machine, Toolpath.as_sliced(len(chosen.job.contours))
    )
    plan = schedule(chosen.job, chosen.machine, chosen.graph, paths)
    assert all(np.isfinite(head.path).all() for head in plan.heads)


def test_nothing_to_print(case_of: Callable[..., Any]) -> None:
    """An empty print is an empty plan."""
    chosen = case_of()
    plan = schedule(chosen.job, chosen.machine, chosen.graph, [Toolpath.as_sliced(0)] * 2)
    assert plan.makespan_s == 0.0


def test_one_contour_of_no_length(case_of: Callable[..., Any]) -> None:
    """A dot of zero length is reached, its filament pushed, and left."""
    chosen = case_of([(50, 30, 0.5), (50, 30, 0.5)])
    plan = schedule(
        chosen.job, chosen.machine, chosen.graph, [Toolpath.as_sliced(1), Toolpath.as_sliced(0)]
    )
    kinds = [ActionKind.TRAVEL, ActionKind.PRINT, ActionKind.PARK]
    assert plan.heads[0].kind.tolist() == kinds
    pushed = filament_time(0.1, 40.0, chosen.machine.limits)
    assert plan.heads[0].end_s[1] - plan.heads[0].begin_s[1] == pytest.approx(pushed)


def test_a_head_in_the_way_steps_aside(case_of: Callable[..., Any]) -> None:
    """Both want the middle at once: one waits outside, and nobody deadlocks."""
    chosen = case_of(
        [(50, 10, 0.5), (70, 10, 0.5)],
        [(50, 50, 0.5), (70, 50, 0.5)],
        [(45, 10, 0.5), (65, 12, 0.5)],
        [(55, 50, 0.5), (75, 52, 0.5)],
    )
    pick = [np.array([0, 2], np.int32), np.array([1, 3], np.int32)]
    toolpaths = [Toolpath.of(ids, np.zeros(2, np.bool_)) for ids in pick]
    plan = schedule(chosen.job, chosen.machine, chosen.graph, toolpaths)
    prints = [h.begin_s[h.kind == ActionKind.PRINT] for h in plan.heads]
    ends = [h.end_s[h.kind == ActionKind.PRINT] for h in plan.heads]
    for i, j in product(range(2), range(2)):
        assert ends[0][i] <= prints[1][j] + 1e-9 or ends[1][j] <= prints[0][i] + 1e-9


def test_wide_contours_are_printed_alone(case_of: Callable[..., Any]) -> None:
    """A contour across the bed leaves no space for the other head but its park."""
    wide = [[(15.0, 10.0 + k, 0.5), (105.0, 10.0 + k, 0.5)] for k in range(4)]
    chosen = case_of(*wide)
    pick = [np.array([0, 2], np.int32), np.array([1, 3], np.int32)]
    toolpaths = [Toolpath.of(ids, np.zeros(2, np.bool_)) for ids in pick]
    plan = schedule(chosen.job, chosen.machine, chosen.graph, toolpaths)
    spans = sorted(
        (float(h.begin_s[i]), float(h.end_s[i]))
        for h in plan.heads
        for i in np.flatnonzero(h.kind == ActionKind.PRINT)
    )
    assert all(a[1] <= b[0] + 1e-9 for a, b in pairwise(spans))


def test_out_of_one_heads_reach(case_of: Callable[..., Any]) -> None:
    """What the left head can not reach is refused for it when the right one has work too."""
    chosen = case_of(
        [(112, 10, 0.5), (118, 10, 0.5)],
        [(2, 10, 0.5), (8, 10, 0.5)],
        [(60, 10, 0.5), (70, 10, 0.5)],
    )
    pick = [np.array([0, 1], np.int32), np.array([2], np.int32)]
    toolpaths = [Toolpath.of(ids, np.zeros(len(ids), np.bool_)) for ids in pick]
    with pytest.raises(InputError, match="left can not print contour 0"):
        schedule(chosen.job, chosen.machine, chosen.graph, toolpaths)


def test_one_order_for_everything_is_shared_out(case_of: Callable[..., Any]) -> None:
    """One head's plan stays possible on a machine where no head reaches everything."""
    chosen = case_of([(112, 10, 0.5), (118, 10, 0.5)], [(2, 10, 0.5), (8, 10, 0.5)])
    both = Toolpath.as_sliced(2)
    shared = one_head_toolpaths(chosen.job, chosen.machine, both)
    assert [t.order.tolist() for t in shared] == [[1], [0]]
    plan = schedule(chosen.job, chosen.machine, chosen.graph, [both, Toolpath.as_sliced(0)])
    assert [head.contour[head.contour >= 0].tolist() for head in plan.heads] == [[1], [0]]


def test_out_of_every_heads_reach(case_of: Callable[..., Any]) -> None:
    """A print no head can do is refused with the contour named."""
    chosen = case_of([(50, 10, 0.5), (50, 70, 0.5)])
    with pytest.raises(InputError, match="no head of 'pair' can print contour 0"):
        schedule(
            chosen.job, chosen.machine, chosen.graph, [Toolpath.as_sliced(1), Toolpath.as_sliced(0)]
        )


@pytest.mark.parametrize("order", [[0], [0, 0], [0, 1, 2]])
def test_missing_and_doubled_contours(case_of: Callable[..., Any], order: list[int]) -> None:
    """A toolpath that is not the whole print is refused."""
    chosen = case_of([(50, 10, 0.5), (60, 10, 0.5)], [(50, 20, 0.5), (60, 20, 0.5)])
    wrong = Toolpath.of(np.array(order, np.int32), np.zeros(len(order), np.bool_))
    with pytest.raises(InputError, match=r"contour \d is printed \d times"):
        schedule(chosen.job, chosen.machine, chosen.graph, [wrong, Toolpath.as_sliced(0)])


def test_order_against_the_precedence(case: Callable[..., Any]) -> None:
    """Sequences that contradict the graph are refused, they do not hang."""
    chosen = case(0)
    n = len(chosen.job.contours)
    from_the_end = Toolpath.of(np.arange(n, dtype=np.int32)[::-1], np.zeros(n, np.bool_))
    with pytest.raises(InputError, match="contradict"):
        schedule(chosen.job, chosen.machine, chosen.graph, [from_the_end, Toolpath.as_sliced(0)])
