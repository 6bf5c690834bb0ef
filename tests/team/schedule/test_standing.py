"""What stopping for another head costs, and signals too near, in the times a plan states."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from decmcts.formats.plans.plan_json import read_plan, write_plan
from decmcts.print.plan import ACTION_END, ActionKind, JointPlan, PlanDocument
from decmcts.print.signals import signals_of
from decmcts.print.toolpath import Toolpath
from decmcts.team.schedule.joint_plan import schedule
from decmcts.team.schedule.standing import with_stops
from decmcts.team.schedule.timing import ActionTimes, action_times
from sim.faults import FaultKind
from sim.verify import verify_plan
from tests.mutants.catalogue import Mutant
from tests.mutants.waits import STOP_MUTANTS
from tests.team.schedule.test_joint_plan import random_split
from tests.team.schedule.test_rests import lags_of

REST_S = 0.45
SEEDS = range(4)


def planned(
    case: Any, seed: int, *, cooled: bool = False, turns: bool = False, **fields: Any
) -> tuple[Any, JointPlan]:
    """The machine with these fields, and the plan of a random split for it."""
    machine = replace(case.machine, **fields)
    lags = lags_of(case) if cooled else None
    paths = random_split(case, seed, turns=turns)
    return machine, schedule(case.job, machine, case.graph, paths, lags=lags)


def faults(case: Any, machine: Any, plan: JointPlan) -> set[FaultKind]:
    document = PlanDocument("", machine, case.job.contours, case.graph.pairs(), plan, {})
    return {fault.kind for fault in verify_plan(document, trials=0).faults}


def seconds(plan: JointPlan) -> list[np.ndarray]:
    return [head.end_s - head.begin_s for head in plan.heads]


@pytest.mark.parametrize("cooled", [False, True])
@pytest.mark.parametrize("release", ["action", "point"])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_wait_costs_what_the_controller_needs_to_start_again(
    case: Callable[..., Any], seed: int, release: str, cooled: bool
) -> None:
    """Behind all it waits for, and behind the action before it, a head stands for the rest."""
    chosen = case(seed)
    # without turns who comes first depends on `rest_s`
    options = {"cooled": cooled, "turns": True, "release": release, "signal_interval_s": 0.0}
    free, quick = planned(chosen, seed, rest_s=0.0, **options)
    machine, plan = planned(chosen, seed, rest_s=REST_S, **options)
    for mine, before in zip(seconds(plan), seconds(quick), strict=True):
        assert np.allclose(mine, before)
    for h, head in enumerate(plan.heads):
        given = {
            edge.action
            for other in plan.heads
            for k in range(len(other))
            for edge in other.after_edges(k)
            if edge.head == h and edge.point == ACTION_END
        }
        stops = {k for k in given if release == "action" or head.kind[k] == ActionKind.WAIT}
        for k in range(len(head)):
            due = [float(head.end_s[k - 1])] if k else [0.0]
            due += [
                float(plan.heads[edge.head].end_s[edge.action])
                for edge in head.after_edges(k)
                if edge.point == ACTION_END
            ]
            stands = len(head.after_edges(k)) > 0 or k - 1 in stops
            assert head.begin_s[k] >= max(due) + REST_S * stands - 1e-9
            points = any(edge.point != ACTION_END for edge in head.after_edges(k))
            assert points or head.begin_s[k] == pytest.approx(max(due) + REST_S * stands)
    assert plan.makespan_s > quick.makespan_s
    assert FaultKind.TIMES not in faults(chosen, machine, plan)
    assert FaultKind.TIMES in faults(chosen, machine, quick)
    assert FaultKind.TIMES not in faults(chosen, free, quick)


def pointed(case: Any, seed: int) -> tuple[JointPlan, list[ActionTimes]]:
    """A plan whose waits for prints are for any points of them, and how long its actions take."""
    rng = np.random.default_rng(seed)
    _, plan = planned(case, seed, release="point", rest_s=0.0, signal_interval_s=0.0)
    heads = []
    for head in plan.heads:
        points = head.after_point.copy()
        for e, (g, k) in enumerate(zip(head.after_head, head.after_action, strict=True)):
            other = plan.heads[g]
            if other.kind[k] == ActionKind.PRINT:
                points[e] = rng.integers(1, len(other.action_path(k)))
        heads.append(replace(head, after_point=points))
    times = [
        action_times(
            case.job, case.machine.limits_of(body), head.path, head.path_offsets, head.contour,
            head.reversed, head.entry, rests=True,
        )
        for head, body in zip(heads, case.machine.heads, strict=True)
    ]  # fmt: skip
    return JointPlan(tuple(heads)), times


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("interval_s", [0.0, 0.1, 0.6, 30.0])
@pytest.mark.parametrize("rest_s", [0.0, REST_S])
def test_a_plan_waits_for_what_its_files_signal(
    case: Callable[..., Any], seed: int, interval_s: float, rest_s: float
) -> None:
    """Places too near are one, or their head stands: so the times are those of the files."""
    chosen = case(seed)
    given, times = pointed(chosen, seed)
    options = {"release": "point", "rest_s": rest_s}
    near = replace(chosen.machine, signal_interval_s=0.0, **options)
    far = replace(near, signal_interval_s=interval_s)
    free, plan = (with_stops(given, chosen.job, machine, times) for machine in (near, far))
    signals = signals_of(plan, chosen.job, interval_s)
    assert all(place == at for place, at in signals.at.items())
    assert FaultKind.TIMES not in faults(chosen, far, plan)
    assert FaultKind.TIMES not in faults(chosen, near, free)
    assert plan.makespan_s >= free.makespan_s
    if interval_s > 0.5:
        assert FaultKind.TIMES in faults(chosen, far, free)
    assert plan.makespan_s > free.makespan_s or interval_s < 1.0


@pytest.mark.parametrize("seed", SEEDS)
def test_a_wait_for_a_point_begins_when_that_is_passed(case: Callable[..., Any], seed: int) -> None:
    """Not before: the rest is behind it."""
    chosen = case(seed)
    given, times = pointed(chosen, seed)
    machine = replace(chosen.machine, release="point", signal_interval_s=0.1, rest_s=REST_S)
    plan = with_stops(given, chosen.job, machine, times)
    for h, head in enumerate(plan.heads):
        for k in np.flatnonzero(np.diff(head.after_offsets)).tolist():
            due = float(head.end_s[k - 1]) if k else 0.0
            for edge in head.after_edges(k):
                other = plan.heads[edge.head]
                passed = float(other.end_s[edge.action])
                if edge.point != ACTION_END:
                    at = np.array([edge.action]), np.array([edge.point], np.int32)
                    passed = float(other.begin_s[edge.action] + times[edge.head].until(*at)[0])
                due = max(due, passed)
            assert head.begin_s[k] == pytest.approx(due + REST_S), (h, k)


@pytest.mark.parametrize("seed", [0, 1, 3])  # which have a place for either
@pytest.mark.parametrize("mutant", STOP_MUTANTS, ids=lambda mutant: mutant.name)
def test_times_without_stops_are_a_fault(
    case: Callable[..., Any], tmp_path: Path, mutant: Mutant[dict[str, Any]], seed: int
) -> None:
    """In a plan that is right in all else, so nothing but the times gives it away."""
    chosen = case(seed)
    machine, plan = planned(chosen, seed, release="point", signal_interval_s=0.6, rest_s=REST_S)
    document = PlanDocument("", machine, chosen.job.contours, chosen.graph.pairs(), plan, {})
    write_plan(document, tmp_path / "plan.json")
    good = verify_plan(read_plan(tmp_path / "plan.json"), trials=0).kinds()
    assert FaultKind.TIMES not in good
    spoilt = json.loads((tmp_path / "plan.json").read_text())
    mutant.spoil(spoilt, np.random.default_rng(seed))
    (tmp_path / "plan.json").write_text(json.dumps(spoilt))
    verdict = verify_plan(read_plan(tmp_path / "plan.json"), trials=0)
    assert verdict.kinds() == good | {FaultKind.TIMES}
    said = [fault.text for fault in verdict.faults if fault.kind == FaultKind.TIMES]
    due = "to start again" if mutant.name == "a head starts again at once" else "tells 0.6 s apart"
    assert all(due in text for text in said), said


def test_one_head_alone_never_stops(case: Callable[..., Any]) -> None:
    """It waits for nobody."""
    chosen = case(0)
    wide = replace(chosen.machine.heads[0], reach_max=(200.0, 60.0, 50.0))
    lone = replace(chosen.machine, heads=(wide,), rails=(), rest_s=REST_S)
    n = len(chosen.job.contours)
    order = [Toolpath.of(np.arange(n, dtype=np.int32), np.zeros(n, np.bool_))]
    plans = [
        schedule(chosen.job, machine, chosen.graph, order)
        for machine in (lone, replace(lone, rest_s=0.0))
    ]
    assert plans[0].makespan_s == plans[1].makespan_s
