"""A head alone runs on from contour to contour: no plan of it is faster than the bound."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from decmcts.print.job import ProcessSettings
from decmcts.print.motion import job_times
from decmcts.print.seam import seam_entries
from decmcts.print.toolpath import Toolpath
from decmcts.team.bounds.makespan import makespan_bound
from decmcts.team.bounds.run_on import saved_by_running_on
from decmcts.team.schedule.joint_plan import schedule


def row_of(case_of: Callable[..., Any], gap_mm: float, settings: ProcessSettings) -> Any:
    """Strokes of 1 mm in a row, so far from each other, for one head that parks at the first."""
    xs = 5.0 + (1.0 + gap_mm) * np.arange(40)
    chosen = case_of(*([(x, 10, 0.5), (x + 1.0, 10, 0.5)] for x in xs))
    head = replace(chosen.machine.heads[0], park=(5.0, 10.0, 0.5))
    machine = chosen.machine.alone(head)
    return replace(chosen, machine=machine, job=replace(chosen.job, settings=settings))


@pytest.mark.parametrize("gap_mm", [0.0, 0.02, 0.3, 1.0])
@pytest.mark.parametrize("retract_mm", [0.0, 0.8])
@pytest.mark.parametrize("wipe_mm", [0.0, 0.5])
def test_a_head_that_runs_on_does_not_beat_the_bound(
    case_of: Callable[..., Any], gap_mm: float, retract_mm: float, wipe_mm: float
) -> None:
    """It did: each contour was counted from rest to rest."""
    settings = ProcessSettings(
        travel_feed=300.0, retract_mm=retract_mm, wipe_mm=wipe_mm, wipe_filament_mm=0.8
    )
    chosen = row_of(case_of, gap_mm, settings)
    plan = schedule(chosen.job, chosen.machine, chosen.graph, [Toolpath.as_sliced(40)])
    bound = makespan_bound(chosen.job, chosen.machine, chosen.graph).bound_s
    rests = job_times(chosen.job, chosen.machine.limits).sum()
    assert bound <= plan.makespan_s
    assert gap_mm > 0.02 or plan.makespan_s < rests


def test_nothing_is_saved_where_travels_are_retracted(case_of: Callable[..., Any]) -> None:
    """Then contours begin and end at rest; and so they do between heads of a team."""
    settings = ProcessSettings(travel_feed=120.0, retract_mm=0.8, retract_min_travel_mm=0.5)
    far = row_of(case_of, 0.6, settings)
    assert saved_by_running_on(far.job, far.machine)[1:].tolist() == [0.0] * 39
    near = row_of(case_of, 0.4, settings)
    assert saved_by_running_on(near.job, near.machine)[1:].min() > 0.0
    team = case_of([(20, 10, 0.5), (21, 10, 0.5)], [(21, 10, 0.5), (22, 10, 0.5)])
    assert saved_by_running_on(team.job, team.machine).tolist() == [0.0, 0.0]


def test_no_more_is_saved_than_speed_at_both_ends(case_of: Callable[..., Any]) -> None:
    """Between two strokes that abut one takes as long as at its feed throughout."""
    abutting = row_of(case_of, 0.0, ProcessSettings(travel_feed=120.0))
    rests = job_times(abutting.job, abutting.machine.limits)
    saved = saved_by_running_on(abutting.job, abutting.machine)
    assert (rests - saved)[1:-1] == pytest.approx(1.0 / 40.0)


@pytest.mark.parametrize("seed", range(3))
def test_one_head_with_loops_entered_anywhere(case: Callable[..., Any], seed: int) -> None:
    """Whatever vertex each loop is entered at, and whichever way it runs."""
    chosen = case(seed, towers=3)
    machine, n = chosen.machine.alone(chosen.machine.heads[0]), len(chosen.job.contours)
    job = replace(chosen.job, settings=ProcessSettings(travel_feed=300.0))
    entries, rng = seam_entries(job.contours), np.random.default_rng(seed)
    bound = makespan_bound(job, machine, chosen.graph, entries=entries).bound_s
    rows = [
        int(rng.integers(low, high))
        for low, high in zip(entries.offsets[:-1], entries.offsets[1:], strict=True)
    ]
    path = replace(Toolpath.as_sliced(n), entry=entries.vertices[rows])
    assert bound <= schedule(job, machine, chosen.graph, [path]).makespan_s
