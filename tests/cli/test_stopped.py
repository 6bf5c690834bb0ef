"""Whoever asks a run to end gets the best so far at once, not after more work."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from decmcts.cli import no_slower, order_search, pipeline
from decmcts.cli.bound import bound_line
from decmcts.cli.pipeline import Planned, load, plan_single
from decmcts.formats.mesh import SliceOptions
from decmcts.print.plan import ActionKind, JointPlan
from tests.cli.test_first_check import LAYERS

ORDER = order_search.plan_order


@pytest.fixture
def searched(monkeypatch) -> list[str]:
    """Return the planners that were run, with as many bounds as were tried."""
    names: list[str] = []

    def recorded(problem, *, planner, **options):
        names.append(planner)
        return ORDER(problem, planner=planner, **options)

    monkeypatch.setattr(order_search, "plan_order", recorded)
    monkeypatch.setattr(pipeline, "early_bound", lambda *_args, **_options: names.append("bound"))
    return names


def planned_when_stopped(tmp_path: Path, said: list[str], objective: str = "travel") -> Planned:
    path = tmp_path / "in.gcode"
    path.write_text(LAYERS)
    loaded = load(path, "paper", process_order="keep", options=SliceOptions(), announce=said.append)
    return plan_single(
        loaded, planner="hybrid", freedom="reversible", time_limit_s=60.0, seed=0,
        announce=said.append, certificate=True, objective=objective, stop=lambda: True,
    )  # fmt: skip


def test_a_stop_before_the_search_searches_nothing(tmp_path, searched):
    """On an empty cache the kernels of a search compile for minutes; a system going down waits
    for none of them."""
    said: list[str] = []
    planned = planned_when_stopped(tmp_path, said)
    assert searched == ["slicer"]
    assert planned.after.metrics["as_sliced"] is True
    assert not [line for line in said if line.startswith(("searching", "a first", "proving"))]


def test_a_stop_proves_no_bound(tmp_path, searched):
    """A proof takes up to 10 s more; that there is none is said with its reason."""
    metrics = planned_when_stopped(tmp_path, []).after.metrics
    assert metrics["bound_mm"] is None
    assert bound_line(metrics) == "no bound on the travel: stopped before one was proven"


def test_no_second_search_is_announced_after_a_stop(tmp_path, searched):
    """A line that says a search begins, where none does, is a reason to press Ctrl-C again."""
    said: list[str] = []
    planned = planned_when_stopped(tmp_path, [])
    times = no_slower.FileTimes(1.0, 9.0)
    no_slower._again(planned, times, tmp_path / "d", tmp_path / "o", said.append, lambda: True)
    assert said == []


@pytest.mark.parametrize("change", [{"reversed": True}, {"entry": 1}])
def test_as_sliced_means_directions_and_entries_too(tmp_path, searched, change):
    """Said of a plan that runs a contour backwards, "the source's own order" is half the truth."""
    lane = planned_when_stopped(tmp_path, []).after.plan.heads[0]
    ((name, value),) = change.items()
    for kind, still in ((ActionKind.PRINT, False), (ActionKind.TRAVEL, True)):
        column = np.array(getattr(lane, name))
        column[np.flatnonzero(lane.kind == kind)[0]] = value
        assert pipeline._as_sliced(JointPlan((replace(lane, **{name: column}),))) is still
