"""Entries of loops for several heads: cheapest along a sequence, kept only where they serve."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from typing import Any, get_args

import numpy as np
import pytest

from decmcts.feasibility.digest import problem_digest
from decmcts.feasibility.rules import order_rules
from decmcts.print.job import PrintJob
from decmcts.print.lags_kernels import no_lags
from decmcts.print.loops import enter_at
from decmcts.print.machine import MotionLimits
from decmcts.print.plan import OrderRules, PlanDocument
from decmcts.print.seam import SeamPolicy, seam_entries
from decmcts.print.toolpath import Toolpath, endpoints, entries_by_contour
from decmcts.search.sequence.pace import pace_of
from decmcts.search.sequence.problem import Pace
from decmcts.team.engine.problem import build_team_problem
from decmcts.team.engine.resolve import resolve
from decmcts.team.schedule.entries import (
    OrderChoices,
    agreed_job,
    best_entries,
    choose_entries,
    first_entries,
    makespan_estimate,
    window_by_window,
    with_entries,
)
from decmcts.team.schedule.joint_plan import schedule
from sim.verify import verify_plan

SEEDS = range(5)
NAMED = [policy for policy in get_args(SeamPolicy) if policy != "nearest"]


@pytest.fixture
def seamy(case: Callable[..., Any]) -> Callable[[int], Any]:
    """Build the case of a seed, its graph right wherever loops begin."""

    def build(seed: int) -> Any:
        made = case(seed)
        graph = order_rules(made.job, made.machine, free_seams=True)
        return replace(made, graph=graph)

    return build


def agreed(case: Any, job: PrintJob | None = None) -> list[Toolpath]:
    """What two heads that plan nothing agree on."""
    problem = build_team_problem(job or case.job, case.machine, case.graph)
    return list(resolve(problem, {}, (0, 1)).toolpaths)


def cost(points: np.ndarray, pace: Pace | None) -> float:
    """Return what a head pays that goes from exit to entry, by the definition."""
    steps = points[1::2] - points[:-1:2]
    if pace is None:
        return float(np.linalg.norm(steps, axis=1).sum())
    total = 0.0
    for x, y, z in steps.tolist():
        level, rise = float(np.hypot(x, y)), abs(z)
        for s, v, a in (
            (level, pace.speed, pace.acceleration),
            (rise, pace.z_speed, pace.z_acceleration),
        ):
            total += (2 * np.sqrt(s / a) if s < v * v / a else s / v + v / a) if s else 0.0
        total += pace.hop_s if level + rise > pace.free_mm else 0.0
    return total


def legs(case: Any, r: int, path: Toolpath) -> np.ndarray:
    """Return park, entry, exit, entry, exit, ..., park of one head."""
    park = np.array(case.machine.heads[r].park)
    first, last = endpoints(case.job.contours, path)
    inner = np.stack([first, last], axis=1).reshape(-1, 3)
    return np.concatenate([park[None], inner, park[None]])


@pytest.mark.parametrize("objective", ["travel", "time"])
@pytest.mark.parametrize("seed", SEEDS)
def test_entries_cost_least_along_a_sequence(
    seed: int, objective: Any, seamy: Callable[[int], Any]
) -> None:
    """Against every choice of entry and direction there is, from park to park, head by head."""
    case = seamy(seed)
    slow = MotionLimits(max_acceleration=(200.0, 200.0, 50.0, 5000.0))
    heads = (case.machine.heads[0], replace(case.machine.heads[1], limits=slow))
    machine = replace(case.machine, heads=heads)
    rng, n = np.random.default_rng(seed), len(case.job.contours)
    few = rng.permutation(n)[:10]
    paths = [Toolpath.of(part, np.zeros(5, np.bool_)) for part in (few[:5], few[5:])]
    entries = seam_entries(case.job.contours)
    chosen = choose_entries(
        case.job, machine, case.graph, paths, OrderChoices("seam", "nearest", objective)
    )
    for r, (path, found) in enumerate(zip(paths, chosen, strict=True)):
        assert (found.order == path.order).all()
        limits = machine.limits_of(machine.heads[r])
        pace = pace_of(case.job, limits) if objective == "time" else None
        ways = [
            [(False, v) for v in entries.vertices[entries.offsets[c] : entries.offsets[c + 1]]]
            if case.job.contours.closed[c]
            else [(False, 0), (True, 0)]
            for c in path.order
        ]
        least = min(
            cost(legs(case, r, replace(path, reversed=np.array(b), entry=np.array(v))), pace)
            for b, v in (zip(*way, strict=True) for way in product(*ways))
        )
        assert cost(legs(case, r, found), pace) == pytest.approx(least)


@pytest.mark.parametrize("freedom", ["reversible", "seam"])
def test_other_entries_are_kept_where_the_print_ends_sooner(
    freedom: Any, seamy: Callable[[int], Any]
) -> None:
    """Less travel of one head may make another wait; the judge passes what is chosen."""
    sooner = 0
    for seed in SEEDS:
        case = seamy(seed)
        paths, none = agreed(case), no_lags(len(case.job.contours))
        makespan = makespan_estimate(case.job, case.machine, case.graph, none)
        found = best_entries(case.job, case.machine, case.graph, paths, OrderChoices(freedom), none)
        assert [path.order.tolist() for path in found] == [path.order.tolist() for path in paths]
        before, after = makespan(paths), makespan(found)
        assert after <= before
        sooner += after < before
        if after < before:
            assert any(path.entry.any() for path in found) == (freedom == "seam")
        else:
            assert [path.entry.tolist() for path in found] == [p.entry.tolist() for p in paths]
        plan = schedule(case.job, case.machine, case.graph, found)
        digest = problem_digest(case.job.contours, case.graph, case.machine)
        rules = OrderRules("keep", False, None, freedom)
        document = PlanDocument(
            digest, case.machine, case.job.contours, case.graph.pairs(), plan, {}, rules=rules
        )
        assert not verify_plan(document, source=case.job).faults
    assert sooner >= len(SEEDS) - 1


def test_windows_find_what_all_at_once_would_lose(seamy: Callable[[int], Any]) -> None:
    """Of a joint order whose second half gets slower, the first half is still changed."""
    case = seamy(0)
    paths, n = agreed(case), len(case.job.contours)

    def makespan(tried: Sequence[Toolpath]) -> float:
        late = sum(int((path.entry[path.turn >= n // 2] > 0).sum()) for path in tried)
        soon = sum(int((path.entry[path.turn < n // 2] > 0).sum()) for path in tried)
        return float(100 * late - soon)

    chosen = choose_entries(case.job, case.machine, case.graph, paths, OrderChoices("seam"))
    found = window_by_window(paths, chosen, n, makespan)
    for path, want in zip(found, chosen, strict=True):
        assert path.turn is not None
        assert path.entry.tolist() == np.where(path.turn < n // 2, want.entry, 0).tolist()


@pytest.mark.parametrize("policy", NAMED)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_policy_s_seams_stay(seed: int, policy: Any, seamy: Callable[[int], Any]) -> None:
    """However much sooner the print ended with others."""
    case, orders = seamy(seed), OrderChoices("seam", policy)
    entry = first_entries(case.job, orders, Toolpath.as_sliced(len(case.job.contours)))
    paths = with_entries(agreed(case, agreed_job(case.job, orders, entry)), entry)
    none = no_lags(len(case.job.contours))
    found = best_entries(case.job, case.machine, case.graph, paths, orders, none)
    assert entries_by_contour(found, len(entry)).tolist() == entry.tolist()


def test_loops_are_first_entered_as_one_head_alone_would(seamy: Callable[[int], Any]) -> None:
    """With the other freedoms, as sliced."""
    case = seamy(3)
    alone = Toolpath.as_sliced(len(case.job.contours))
    alone = replace(alone, entry=np.where(case.job.contours.closed, 2, 0).astype(np.int32))
    assert first_entries(case.job, OrderChoices("seam"), alone).tolist() == alone.entry.tolist()


@pytest.mark.parametrize("policy", NAMED)
@pytest.mark.parametrize("seed", SEEDS)
def test_loops_begin_where_a_policy_says_and_agents_plan_them_so(
    seed: int, policy: Any, seamy: Callable[[int], Any]
) -> None:
    """All of them, on whichever head; the makespan agents agree on is the plan's own."""
    case, orders = seamy(seed), OrderChoices("seam", policy)
    alone = Toolpath.as_sliced(len(case.job.contours))
    planned = agreed_job(case.job, orders, first_entries(case.job, orders, alone))
    paths = with_entries(agreed(case, planned), first_entries(case.job, orders, alone))
    entry = entries_by_contour(paths, len(case.job.contours))
    assert entry.tolist() == seam_entries(case.job.contours, policy).vertices.tolist()
    run = enter_at(case.job.contours, entry)
    assert (run.points == planned.contours.points).all() and entry.any()
    plan = schedule(case.job, case.machine, case.graph, paths)
    bare = [replace(path, entry=np.zeros_like(path.entry)) for path in paths]
    assert plan.makespan_s == schedule(planned, case.machine, case.graph, bare).makespan_s


def test_accelerations_follow_the_points_of_a_loop(seamy: Callable[[int], Any]) -> None:
    """A source may set one for a corner; it stays with that segment."""
    case, orders = seamy(2), OrderChoices("seam", "rear")
    alone = Toolpath.as_sliced(len(case.job.contours))
    points = case.job.contours.points
    job = replace(case.job, acceleration=np.arange(len(points), dtype=float))
    planned = agreed_job(job, orders, first_entries(job, orders, alone))
    assert planned.acceleration is not None
    assert len(planned.acceleration) == len(planned.contours.points)
    for k in np.flatnonzero(planned.contours.extrusion > 0):
        was = int(planned.acceleration[k])
        assert (points[was] == planned.contours.points[k]).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_fixed_reverses_nothing(seed: int, seamy: Callable[[int], Any]) -> None:
    """Even a head whose plan says so."""
    case = seamy(seed)
    never = np.zeros(len(case.job.contours), np.int32)
    orders, none = OrderChoices("fixed"), no_lags(len(case.job.contours))
    paths = agreed(case, agreed_job(case.job, orders, never))
    assert not any(path.reversed.any() for path in paths)
    assert any(path.reversed.any() for path in agreed(case))
    assert best_entries(case.job, case.machine, case.graph, paths, orders, none) == paths
