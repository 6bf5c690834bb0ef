"""Shares of travels: no travel takes less, no plan leaves them out, the bound counts them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.job import PrintJob, ProcessSettings
from decmcts.print.machine import MotionLimits
from decmcts.print.plan import ActionKind
from decmcts.print.seam import seam_entries
from decmcts.print.toolpath import Toolpath
from decmcts.search.bounds.chains_kernels import COVERED, FAR, UNRELATED, ancestry
from decmcts.team.bounds.least_travel import FastestTravel, travel_shares
from decmcts.team.bounds.makespan import makespan_bound
from decmcts.team.schedule.joint_plan import schedule
from decmcts.team.schedule.timing import action_times
from tests.team.conftest import make_machine
from tests.team.schedule.test_joint_plan import random_split

HABITS = {
    "bare": ProcessSettings(travel_feed=150.0),
    "retracted": ProcessSettings(travel_feed=100.0, retract_mm=1.0, z_feed=5.0),
    "from 5 mm": ProcessSettings(travel_feed=150.0, retract_mm=0.8, retract_min_travel_mm=5.0),
    "wiped": ProcessSettings(
        travel_feed=150.0, retract_mm=0.8, wipe_mm=0.6, wipe_filament_mm=0.5, wipe_feed=200.0
    ),
    "combed": ProcessSettings(
        travel_feed=150.0, retract_mm=0.8, retract_min_travel_mm=1.0, bare_inside_mm=30.0,
        bare_climb_mm=0.6,
    ),
}  # fmt: skip
LIMITS = {
    "none": MotionLimits(jerk=(0.0, 0.0, 0.0, 0.0)),
    "jerk": MotionLimits(jerk=(15.0, 8.0, 2.0, 5.0)),
    "deviation": MotionLimits(junction_deviation=0.05),
}


def paths_of(rng: np.random.Generator) -> list[np.ndarray]:
    """Return one travel in one to three legs, each lifted or not; the contour before ends at 0."""
    stops = np.vstack([np.zeros(3), rng.uniform(0, 8.0 ** rng.uniform(-1, 1.5), (3, 3))])
    stops[:, 2] = np.round(rng.uniform(0, 1.2, 4) if rng.random() < 0.5 else 0.0, 2) + 0.2
    legs = []
    for one, other in pairwise(stops[: int(rng.integers(2, 5))]):
        top = max(one[2], other[2]) + rng.choice([0.0, 0.6])
        path = np.array([one, [*one[:2], top], [*other[:2], top], other])
        moves = (np.diff(path, axis=0) != 0.0).any(axis=1)
        legs.append(path[np.append(True, moves)])
    return legs


@pytest.mark.parametrize("limits", LIMITS)
@pytest.mark.parametrize("habit", HABITS)
def test_no_travel_takes_less(case_of: Callable[..., Any], habit: str, limits: str) -> None:
    """However it is retracted, lifted, stopped on the way or left bare inside the part."""
    rng = np.random.default_rng(len(habit) + len(limits))
    line = [(-20.0, 0.0, 0.2), (0.0, 0.0, 0.2)]
    square = [(-30, -30, 0.2), (30, -30, 0.2), (30, 30, 0.2), (-30, 30, 0.2), (-30, -30, 0.2)]
    job = replace(case_of(line, square).job, settings=HABITS[habit])
    machine = replace(make_machine(), limits=LIMITS[limits])
    pace, ratios = FastestTravel.of(job, machine), []
    for _ in range(120):
        legs = paths_of(rng)
        offsets = np.cumsum([0, 2, *map(len, legs)])
        contour, zero = (
            np.array([0, *(-1 for _ in legs)], np.int32),
            np.zeros(len(legs) + 1, np.int32),
        )
        path = np.concatenate([np.array(line), *legs])
        taken = action_times(
            job, LIMITS[limits], path, offsets, contour, zero > 0, zero, rests=True
        ).seconds[1:].sum()  # fmt: skip
        least = pace.seconds(np.linalg.norm(legs[-1][-1] - legs[0][0], keepdims=True))[0]
        assert least <= taken * (1 + 1e-9)
        ratios.append(least / taken)
    assert max(ratios) > 0.8


@pytest.mark.parametrize("seed", range(5))
def test_ancestry_is_that_of_the_closure(seed: int) -> None:
    """Against all paths of a random graph, about random earlier contours."""
    rng, n = np.random.default_rng(seed), 40
    edges = {tuple(sorted(rng.choice(n, 2, replace=False))) for _ in range(70)}
    graph = DependencyGraph.from_pairs(n, np.array(sorted(edges), np.int32))
    before: list[set[int]] = []
    far: list[set[int]] = []
    for b in range(n):
        direct = {a for a, c in edges if c == b}
        far.append(set().union(*(before[a] for a in direct)) if direct else set())
        before.append(direct | far[b])
    asked = [rng.choice(b, min(b, 9), replace=False) if b else np.empty(0, int) for b in range(n)]
    offsets = np.cumsum([0, *map(len, asked)]).astype(np.int64)
    earlier = np.concatenate(asked).astype(np.int32)
    found = ancestry(offsets, earlier, graph.pred_offsets, graph.preds)
    later = np.repeat(np.arange(n), np.diff(offsets))
    wanted = [
        FAR if a in far[b] else COVERED if a in before[b] else UNRELATED
        for a, b in zip(earlier, later, strict=True)
    ]
    assert found.tolist() == wanted
    assert {FAR, COVERED, UNRELATED} == set(wanted)


def gaps_of(job: PrintJob, machine: Any, graph: DependencyGraph, paths: list[Toolpath]) -> Any:
    """Yield the contours heads print one after the other, and the seconds between."""
    for head in schedule(job, machine, graph, paths).heads:
        prints = np.flatnonzero(head.kind == ActionKind.PRINT)
        for one, other in pairwise(prints):
            between = head.begin_s[other] - head.end_s[one]
            yield head.contour[one], head.contour[other], between


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("habit", HABITS)
def test_no_plan_leaves_a_share_out(case: Callable[..., Any], habit: str, seed: int) -> None:
    """Between two contours of a head there is time for the shares of both ends."""
    chosen = case(seed, towers=8)
    job = replace(chosen.job, settings=HABITS[habit])
    machine = replace(chosen.machine, limits=LIMITS["jerk"])
    time = np.full(len(job.contours), 1e9)
    for head in schedule(job, machine, chosen.graph, random_split(chosen, seed)).heads:
        prints = head.kind == ActionKind.PRINT
        time[head.contour[prints]] = (head.end_s - head.begin_s)[prints]
    shares = travel_shares(job, machine, chosen.graph, time)
    assert shares.leaving.max() > 0.0 and shares.entering.max() > 0.0
    for split in range(4):
        for a, b, between in gaps_of(job, machine, chosen.graph, random_split(chosen, split)):
            assert shares.leaving[a] + shares.entering[b] <= between + 1e-9


@pytest.mark.parametrize("seed", range(3))
def test_no_plan_with_loops_entered_anywhere_leaves_a_share_out(
    case: Callable[..., Any], seed: int
) -> None:
    """Shares count from the nearest of all vertices a loop may be entered at."""
    chosen = case(seed, towers=8)
    rng, entries = np.random.default_rng(seed), seam_entries(chosen.job.contours)
    time = np.full(len(chosen.job.contours), 10.0)
    shares = travel_shares(chosen.job, chosen.machine, chosen.graph, time, entries)
    for split in range(4):
        rows = rng.integers(entries.offsets[:-1], entries.offsets[1:])
        entry = entries.vertices[rows]
        paths = [replace(p, entry=entry[p.order]) for p in random_split(chosen, split)]
        for a, b, between in gaps_of(chosen.job, chosen.machine, chosen.graph, paths):
            assert shares.leaving[a] + shares.entering[b] <= between + 1e-9


def test_a_row_of_strokes_in_one_place(case_of: Callable[..., Any]) -> None:
    """Ten strokes 5 mm apart that any head may print next, where only one fits at a time.

    Of nine travels at least six count: two heads have a first and a last contour each.
    """
    strokes = [[(58.0, 5.0 + 5.0 * k, 0.5), (60.0, 5.0 + 5.0 * k, 0.5)] for k in range(10)]
    chosen = case_of(*strokes)
    settings = ProcessSettings(travel_feed=100.0, retract_mm=1.0)
    job = replace(chosen.job, settings=settings)
    bound = makespan_bound(job, chosen.machine, chosen.graph)
    bare = makespan_bound(job, chosen.machine, chosen.graph, travel=False)
    one = float(FastestTravel.of(job, chosen.machine).seconds(np.array([5.0]))[0])
    assert bare.bound_s == pytest.approx(bare.serial_s, rel=1e-4)
    assert bound.serial_s == bare.serial_s and bare.travel_s == 0.0
    assert 6 * one * 0.999 <= bound.travel_s <= 9 * one
    assert bound.bound_s == pytest.approx(bound.serial_s + bound.travel_s, rel=1e-3)


@pytest.mark.parametrize("seed", range(6))
def test_no_plan_is_faster_with_travels_counted(case: Callable[..., Any], seed: int) -> None:
    """Not that of one head alone either, where all the shares but two of each end count."""
    chosen = case(seed, towers=5, reach=3.0)
    n = len(chosen.job.contours)
    none = Toolpath.of(np.empty(0, np.int32), np.empty(0, np.bool_))
    bound = makespan_bound(chosen.job, chosen.machine, chosen.graph)
    bare = makespan_bound(chosen.job, chosen.machine, chosen.graph, travel=False)
    assert bound.bound_s > bare.bound_s * 1.001
    splits = [random_split(chosen, k) for k in range(5)] + [[Toolpath.as_sliced(n), none]]
    for paths in splits:
        plan = schedule(chosen.job, chosen.machine, chosen.graph, paths)
        assert bound.bound_s <= plan.makespan_s
