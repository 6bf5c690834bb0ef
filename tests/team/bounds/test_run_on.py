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
