"""Contours are cut where heads that share them end the print sooner."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.planning.events import unheard
from decmcts.planning.options import Cut, Freedom, Rules, TeamSearch
from decmcts.planning.problem.print_problem import load, problem_of
from decmcts.planning.read import read
from decmcts.planning.result import Result
from decmcts.planning.team.cutting import best_sweep
from decmcts.planning.team.pipeline import plan_team, prepared, swept
from decmcts.planning.verify import verify
from decmcts.print.job import PrintJob
from decmcts.team.bounds.makespan import makespan_bound
from decmcts.team.schedule.entries import entries_of
from sim.content.inventory import move_segments
from sim.heads.file import read_head_file
from sim.verify import verify_plan
from tests.planning.conftest import Agents
from tests.prints import slab


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return slab(tmp_path_factory.mktemp("slab") / "slab.gcode")


@pytest.fixture(scope="module")
def result(source: Path) -> Result:
    """A slab planned for two heads with all its contours cut."""
    search = TeamSearch(1.0, cut=Cut.ALL)
    problem = problem_of(read(source, "dual-gantry"), Rules(), unheard)
    return Result(plan_team(problem, search, writes=True, agents=Agents()), search)


def test_the_more_is_cut_the_sooner_a_sweep_ends(source: Path) -> None:
    """One slab 200 mm wide: whole nothing can be shared, cut nearly all."""
    problem = load(source, "dual-gantry")
    ends = {}
    for cut in Cut:
        swept = best_sweep(problem, cut, unheard)
        assert swept is not None
        ends[cut] = swept.makespan_s
    assert ends[Cut.NONE] > 1.2 * ends[Cut.INSIDE]
    assert ends[Cut.INSIDE] > 1.05 * ends[Cut.ALL]


def test_the_bound_of_pieces_holds_wherever_loops_are_entered(source: Path) -> None:
    """Loops that stay whole may be entered elsewhere yet, so a bound as sliced proves nothing."""
    seams = Rules(freedom=Freedom.SEAM)
    problem = problem_of(read(source, "dual-gantry"), seams, unheard)
    search = TeamSearch(0.5, cut=Cut.INSIDE)
    ready = swept(prepared(problem, search, writes=False), search, unheard)
    assert ready.whole is not None
    pieces, entries = ready.problem, entries_of(ready.problem.job, ready.orders)
    assert entries is not None
    due = makespan_bound(pieces.job, pieces.machine, pieces.graph, entries=entries)
    assert ready.bound.result() == due


def test_heads_share_one_part(result: Result) -> None:
    """They print side by side, and the plan says what was cut."""
    after = result.planned.after
    assert after.metrics["one_head_s"] / after.metrics["makespan_s"] > 1.3
    assert after.contours.of is not None and after.rules is not None
    assert after.rules.cut == "all" and after.metrics["cut"]["cuts"] > 20


def test_accelerations_of_pieces_are_the_source_s(result: Result) -> None:
    """A plan that states others is refused, as it is of whole contours."""
    after, job = result.planned.after, result.planned.problem.job
    due = job.accelerations
    assert verify_plan(replace(after, acceleration=due), source=whole_job(result), trials=0).ok
    spoilt = verify_plan(
        replace(after, acceleration=due + 500.0), source=whole_job(result), trials=0
    )
    assert any("acceleration" in fault.text for fault in spoilt.faults)


def whole_job(result: Result) -> PrintJob:
    """Return the print as it was before it was cut."""
    whole = result.planned.problem.whole
    assert whole is not None
    return whole.job


def test_files_of_a_cut_print_hold_the_source_s_path(
    result: Result, source: Path, tmp_path: Path
) -> None:
    """Point by point: what both files lay down is the source's, filament to the last digit."""
    result.write_plan(tmp_path / "plan.json")
    files = result.write_gcode(tmp_path / "part").paths
    assert verify(files, source, plan=tmp_path / "plan.json").ok
    assert verify(tmp_path / "plan.json", source).ok
    with pytest.raises(InputError, match="add --plan"):
        verify(files, source, machine="dual-gantry")
    laid: dict[float, float] = defaultdict(float)
    words = result.planned.problem.machine.words
    length = 0.0
    for path in files:
        motion = read_head_file(path, words).motion
        rows = np.flatnonzero(
            (motion.extrusion > 0) & (np.diff(motion.points[:, :2], axis=0) != 0).any(axis=1)
        )
        segments = move_segments(motion.points, motion.extrusion, motion.feed, motion.line, rows)
        step = segments.ends[:, 3:] - segments.ends[:, :3]
        length += float(np.linalg.norm(step, axis=1).sum())
        for z, e in zip(segments.ends[:, 2], segments.extrusion, strict=True):
            laid[round(float(z), 3)] += float(e)
    contours = load(source, "dual-gantry").job.contours
    due: dict[float, float] = defaultdict(float)
    for z, e in zip(contours.points[:, 2], contours.extrusion, strict=True):
        due[round(float(z), 3)] += float(e)
    assert laid == pytest.approx(due, abs=1e-9)
    step = np.diff(contours.points, axis=0)
    inside = np.ones(len(step), np.bool_)
    inside[contours.offsets[1:-1] - 1] = False
    assert length == pytest.approx(np.linalg.norm(step[inside], axis=1).sum(), abs=0.05)


def test_views_have_the_source_beside_the_pieces(result: Result, tmp_path: Path) -> None:
    """Each contour of the source stands under the number of its first piece."""
    result.write_report(tmp_path / "report.html")
    result.write_picture(tmp_path / "picture.svg")
    assert (tmp_path / "report.html").stat().st_size > 10_000
