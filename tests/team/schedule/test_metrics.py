"""The figures of a plan."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from decmcts.print.plan import ActionKind
from decmcts.print.toolpath import Toolpath, extrusionless_travel
from decmcts.team.schedule.joint_plan import schedule
from decmcts.team.schedule.metrics import plan_metrics


def test_figures_of_one_head(case: Callable[..., Any]) -> None:
    """Both travels, the time and the count, against sums written out."""
    chosen = case(4)
    n = len(chosen.job.contours)
    sliced = Toolpath.as_sliced(n)
    plan = schedule(chosen.job, chosen.machine, chosen.graph, [sliced, Toolpath.as_sliced(0)])
    found = plan_metrics(chosen.job, plan)
    emitted = sum(
        float(np.linalg.norm(np.diff(head.action_path(i), axis=0), axis=1).sum())
        for head in plan.heads
        for i in range(len(head))
        if head.kind[i] != 0
    )
    assert found["contours_per_head"] == [n, 0]
    assert found["extrusionless_travel_mm"] == pytest.approx(
        extrusionless_travel(chosen.job.contours, sliced)
    )
    assert found["emitted_travel_mm"] == pytest.approx(emitted)
    assert found["print_time_s"] == plan.makespan_s == found["busy_s_per_head"][0]
    parts = [found[f"{what}_s_per_head"][0] for what in ("printing", "travelling")]
    printing = plan.heads[0].kind == ActionKind.PRINT
    time = plan.heads[0].end_s - plan.heads[0].begin_s
    assert parts == [pytest.approx(time[printing].sum()), pytest.approx(time[~printing].sum())]
    assert found["cross_head_waits"] == 0
