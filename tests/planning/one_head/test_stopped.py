"""Whoever asks a run to end gets the best so far at once, not after more work."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from decmcts.planning.events import Event, Step
from decmcts.planning.one_head import pipeline
from decmcts.planning.one_head.certificate import Certificate
from decmcts.planning.one_head.no_slower import write_no_slower
from decmcts.planning.one_head.pipeline import plan_judged
from decmcts.planning.options import NO_QUALITY, Search
from decmcts.planning.problem.planned import Planned
from decmcts.planning.problem.print_problem import load
from decmcts.planning.writing.file_times import FileTimes
from decmcts.print.plan import ActionKind, JointPlan
from tests.planning.problem.test_first_check import LAYERS

SEARCH = Search(60.0)


def planned_when_stopped(tmp_path: Path, events: list[Event]) -> Planned:
    path = tmp_path / "in.gcode"
    path.write_text(LAYERS)
    problem = load(path, "paper", NO_QUALITY)
    return plan_judged(problem, SEARCH, report=events.append, stop=lambda: True)


def test_a_stop_before_the_search_searches_nothing(tmp_path):
    """On an empty cache the kernels of a search compile for minutes; a system going down waits
    for none of them."""
    events: list[Event] = []
    metrics = planned_when_stopped(tmp_path, events).after.metrics
    assert (metrics["as_sliced"], metrics["iterations"]) == (True, 0)
    said = [event.text for event in events if isinstance(event, Step)]
    assert not [line for line in said if line.startswith(("searching", "a first", "proving"))]


def test_a_stop_proves_no_bound(tmp_path):
    """A proof takes up to 10 s more; that there is none is said with its reason."""
    found = Certificate.of(planned_when_stopped(tmp_path, []).after.metrics)
    assert found is not None
    assert (found.bound, found.skipped) == (None, "stopped before one was proven")


def test_no_second_search_is_announced_after_a_stop(tmp_path):
    """A line that says a search begins, where none does, is a reason to press Ctrl-C again."""
    events: list[Event] = []
    planned, out = planned_when_stopped(tmp_path, []), tmp_path / "out.gcode"
    _, times = write_no_slower(
        planned, SEARCH, out, allow_slower=False, report=events.append, stop=lambda: True,
        draft_of=much_longer,
    )  # fmt: skip
    assert times.kept
    assert out.read_bytes() == (tmp_path / "in.gcode").read_bytes()
    said = [event.text for event in events if isinstance(event, Step)]
    assert said and not any("searching" in line for line in said)


def much_longer(planned: Planned, draft: Path, path: Path) -> FileTimes:
    """Write a draft that takes longer than its source."""
    draft.write_bytes(b"G4 S8")
    return FileTimes(1.0, 9.0)


@pytest.mark.parametrize("change", [{"reversed": True}, {"entry": 1}])
def test_as_sliced_means_directions_and_entries_too(tmp_path, change):
    """Said of a plan that reverses a contour, "the source's own order" is half the truth."""
    actions = planned_when_stopped(tmp_path, []).after.plan.heads[0]
    ((name, value),) = change.items()
    for kind, still in ((ActionKind.PRINT, False), (ActionKind.TRAVEL, True)):
        column = np.array(getattr(actions, name))
        column[np.flatnonzero(actions.kind == kind)[0]] = value
        assert pipeline._as_sliced(JointPlan((replace(actions, **{name: column}),))) is still
