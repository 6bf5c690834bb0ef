"""Search, plan and file agree on which travels are retracted, on layer changes too."""

from __future__ import annotations

import io
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numba import njit

from decmcts.feasibility.graph import DependencyGraph
from decmcts.formats.gcode import read_gcode, write_gcode
from decmcts.formats.gcode.controller.duration import text_time
from decmcts.planning.one_head.pipeline import plan_judged
from decmcts.planning.options import NO_QUALITY, AvoidWalls, PlannerName, Search
from decmcts.planning.problem.print_problem import PrintProblem, load
from decmcts.print.job import PrintJob
from decmcts.print.plan import ActionKind, HeadActions
from decmcts.print.walls import retracts, walls_for
from decmcts.print.walls_kernels import SAME_Z_MM
from decmcts.search.sequence.metric_kernels import (
    NO_WALLS,
    Metric,
    Timed,
    costs_the_same_back,
    distance,
    price,
    with_points,
)
from decmcts.search.sequence.pace import pace_of
from decmcts.search.sequence.problem import OrderProblem
from tests.formats.gcode.reading.test_combing import part
from tests.limits import LIMITS
from tests.makers.corpus import CORPUS

Point = tuple[float, float, float]
PRINTS = (
    "cura_4.6.1_marlin_benchy", "cura_5.2.1_spool", "cura_5.3.1_marlin_lightning",
    "superslicer_2.3.56_klipper_arcs_crlf", "prusaslicer_2.1.1_reprap",
)  # fmt: skip

SLICED = Search(0.1, planner=PlannerName.SLICER, certificate=False)


def metric_of(job: PrintJob) -> Metric:
    """Return what prices travels in a search for time."""
    n, contours = len(job.contours), job.contours
    graph = DependencyGraph.from_pairs(n, np.empty((0, 2), np.int64))
    problem = OrderProblem(
        contours.start, contours.end, np.zeros(n, np.bool_), np.zeros(n, np.int32), graph,
        pace=pace_of(job, LIMITS),
    )  # fmt: skip
    return problem.metric()


def looks_at_walls(job: PrintJob) -> bool:
    """Tell whether the search may find travels bare that stay within walls."""
    metric = metric_of(job)
    assert isinstance(metric, Timed)
    return metric.bare_mm != NO_WALLS


def way_of(p: Point, q: Point) -> list[Point]:
    """Return the way a plan takes where nothing is printed: up, across, down."""
    top = max(p[2], q[2])
    return [p, (*p[:2], top), (*q[:2], top), q]


def seconds(metric: Metric, p: Point, q: Point) -> tuple[float, float]:
    """Return what the search takes for a travel, and that without any retraction."""
    metric = with_points(metric, np.array([p, q]))
    assert not isinstance(metric, np.ndarray)
    return distance(metric, 0, 1), distance(metric._replace(hop_s=0.0), 0, 1)


def kinds_seen(job: PrintJob, rng: np.random.Generator, count: int) -> set[tuple[bool, bool, int]]:
    """Compare search and plan on random travels; return which kinds there were.

    A kind: retracted, longer than the least, -1 down, 0 level or 1 up.
    """
    metric, walls, settings = metric_of(job), walls_for(job), job.settings
    compiled = njit(lambda m, a, b: (distance(m, a, b), costs_the_same_back(m, a, b)))
    ends = np.stack([job.contours.start, job.contours.end], axis=1).reshape(-1, 3)
    seen = set()
    for _ in range(count):
        a = int(rng.integers(len(ends)))
        b = min(max(a + int(rng.normal(0.0, 40.0)), 0), len(ends) - 1)
        p, q = (tuple((ends[x] + (*rng.normal(0, 1, 2) * (a % 2), 0)).tolist()) for x in (a, b))
        found, moving = seconds(metric, p, q)
        due = retracts(walls, settings, way_of(p, q))
        assert found == moving + metric.hop_s * due
        there = with_points(metric, np.array([p, q]))
        assert compiled(there, 0, 1)[0] == pytest.approx(found)
        if compiled(there, 0, 1)[1]:
            assert seconds(metric, q, p)[0] == pytest.approx(found)
        level, rise = math.dist(p[:2], q[:2]), q[2] - p[2]
        assert price(metric, level, abs(rise)) <= found + 1e-12
        changes = int(np.sign(rise)) if abs(rise) > SAME_Z_MM else 0
        seen.add((due, level + abs(rise) >= settings.retract_min_travel_mm, changes))
    return seen


def own_order(path: Path) -> tuple[PrintProblem, HeadActions]:
    """Return a file and the plan of its own order, travels straight as the search has them."""
    loaded = load(path, "paper", replace(NO_QUALITY, avoid_walls=AvoidWalls.NEVER))
    planned = plan_judged(loaded, SLICED)
    return loaded, planned.after.plan.heads[0]


def travels_of(actions: HeadActions) -> list[list[Point]]:
    """Return the ways between contours."""
    prints = np.flatnonzero(actions.kind == ActionKind.PRINT)
    rows = range(prints[0], prints[-1])
    return [
        [tuple(point) for point in actions.action_path(k).tolist()]
        for k in rows if actions.kind[k] == ActionKind.TRAVEL
    ]  # fmt: skip


def retracted(job: PrintJob, actions: HeadActions) -> int:
    """Compare search and plan on every travel of a plan; return how many are retracted.

    Of one that is lifted over what is printed the search may not know.
    """
    metric, walls, count = metric_of(job), walls_for(job), 0
    for way in travels_of(actions):
        found, moving = seconds(metric, way[0], way[-1])
        due = retracts(walls, job.settings, way)
        lifted = max(z for *_, z in way) > max(way[0][2], way[-1][2])
        assert found == moving + metric.hop_s * due or (lifted and found == moving)
        count += due
    return count


def pulls_in(path: Path, actions: HeadActions) -> int:
    """Return how often the file of a plan pulls filament back."""
    job, document = read_gcode(path)
    out = io.BytesIO()
    write_gcode(document, job, actions, out)
    return text_time(out.getvalue(), LIMITS).retractions


@pytest.mark.slow
@pytest.mark.parametrize("bare_changes", [True, False])
def test_search_plan_and_file_agree_on_every_travel(tmp_path, bare_changes):
    """One price: a travel costs the retraction in the search iff plan and file have it."""
    path = tmp_path / "part.gcode"
    path.write_text(part(bare_mm=50.0, layers=8, bare_changes=bare_changes))
    loaded, actions = own_order(path)
    job = loaded.job
    assert looks_at_walls(job)
    seen = kinds_seen(job, np.random.default_rng(3), 3000)
    level = {(False, False, 0), (True, True, 0), (False, True, 0)}
    assert level < seen
    assert (True, True, -1) in seen
    assert (False, True, -1) not in seen
    assert ((False, True, 1) in seen) == bare_changes
    due = retracted(job, actions)
    assert 0 < due < len(travels_of(actions)) // 2
    assert pulls_in(path, actions) == due + 2  # before the first bead, and after the last


@pytest.mark.slow
@pytest.mark.shared
@pytest.mark.usefixtures("needs_corpus")
@pytest.mark.parametrize("name", PRINTS)
def test_they_agree_on_real_files(name):
    """Slicers' walls have gaps, islands and arcs that no made print has."""
    path = CORPUS / "gcode" / f"{name}.gcode.gz"
    loaded, actions = own_order(path)
    job = loaded.job
    assert looks_at_walls(job) == (job.settings.bare_inside_mm > 0.0)
    seen = kinds_seen(job, np.random.default_rng(4), 2000)
    assert {(True, True, change) for change in (-1, 0, 1)} < seen
    assert ((False, True, 0) in seen) == (job.settings.bare_inside_mm > 0.0)
    assert ((False, True, 1) in seen) == (job.settings.bare_climb_mm > 0.0)
    assert pulls_in(path, actions) == retracted(job, actions) + 2
