"""What comes of a plan: figures, and files that are whole or not there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from decmcts.errors import InputError
from decmcts.formats.plans.plan_json import read_plan
from decmcts.planning.options import Freedom, PlannerName, Rules, Seam, Search
from decmcts.planning.plan import plan
from decmcts.planning.problem.source import read
from decmcts.planning.result import Result, bound
from decmcts.planning.verify import verify
from tests.planning.problem.test_first_check import LAYERS
from tests.prints import four_parts

SEARCH = Search(1.0, planner=PlannerName.GREEDY)


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "in.gcode"
    path.write_text(LAYERS)
    return path


@pytest.fixture
def result(source: Path) -> Result:
    return plan(read(source, "paper"), SEARCH)


def test_it_says_what_was_gained_and_what_is_left(result: Result) -> None:
    """Without a look at the metrics, which have names for programs of the command line."""
    assert result.verdict.ok
    assert result.after.travel_mm <= result.before.travel_mm
    assert result.bound is not None and result.bound.bound is not None
    assert result.bound.bound == pytest.approx(result.after.travel_mm)
    assert bound(result) == result.bound
    with pytest.raises(InputError, match="must be at least 0 and finite"):
        bound(result, time_limit_s=-1.0)
    assert result.bound_s is None


def test_a_file_that_would_take_longer_is_not_written(result: Result, source: Path) -> None:
    """The source's copy is; whoever asks for the order gets it."""
    out = source.with_name("out.gcode")
    written = result.write_gcode(out)
    assert written.times is not None and written.times.kept
    assert out.read_bytes() == source.read_bytes()
    written = result.write_gcode(out, allow_slower=True)
    assert written.times is not None and not written.times.kept
    assert out.read_bytes() != source.read_bytes()
    assert verify(out, source, "paper").ok


def test_plan_and_pictures_are_written(result: Result, tmp_path: Path) -> None:
    """Each by the name of its kind."""
    result.write_plan(tmp_path / "plan.json")
    assert read_plan(tmp_path / "plan.json").problem == result.document.problem
    for write, name in (
        (result.write_plan, "plan.gcode"),
        (result.write_report, "report.png"),
        (result.write_picture, "picture.html"),
    ):
        with pytest.raises(InputError, match="must end in"):
            write(tmp_path / name)
        assert not (tmp_path / name).exists()


def test_a_folder_that_is_not_there_is_refused(result: Result, tmp_path: Path) -> None:
    """In the words of the command line, not in the system's."""
    with pytest.raises(InputError, match="no such folder"):
        result.write_plan(tmp_path / "no" / "plan.json")


def test_a_bound_that_was_proven_is_kept(result: Result) -> None:
    """No time is too short for what `plan` has proven already."""
    assert result.bound is not None
    assert bound(result, time_limit_s=0.0) == result.bound


def test_a_kept_source_has_no_bound_where_its_entries_are_not_allowed(tmp_path: Path) -> None:
    """It was an error of the program."""
    rear = Rules(freedom=Freedom.SEAM, seam=Seam.REAR)
    found = plan(read(four_parts(tmp_path), "paper"), SEARCH, rear)
    assert bound(found).bound is not None
    kept = replace(found, planned=replace(found.planned, after=found.planned.before))
    with pytest.raises(InputError, match="the seam policy does not"):
        bound(kept)
