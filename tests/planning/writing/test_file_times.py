"""What makes another file worth writing, and times that add up."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any, cast

import pytest

from decmcts.cli.run import run
from decmcts.formats.gcode.controller.duration import text_time
from decmcts.planning.options import Rules
from decmcts.planning.problem.planned import Planned
from decmcts.planning.writing.file_times import FileTimes, gains
from decmcts.print.machine import MotionLimits
from tests.formats.gcode.text.packed import GOOD, POOR


def planned(was_mm: float, now_mm: float, **rules: Any) -> Planned:
    """Return as much of a result as is asked here."""
    before, after = ({"emitted_travel_mm": mm} for mm in (was_mm, now_mm))
    source = SimpleNamespace(regrouped=None)
    problem = SimpleNamespace(rules=Rules(**rules), source=source)
    made = SimpleNamespace(
        problem=problem,
        before=SimpleNamespace(metrics=before),
        after=SimpleNamespace(metrics=after),
    )
    return cast(Planned, made)


def times(was_s: float | None, now_s: float, **counts: tuple[float, float]) -> FileTimes:
    before, after = ({key: pair[k] for key, pair in counts.items()} for k in (0, 1))
    return FileTimes(was_s, now_s, before=cast(Any, before), after=cast(Any, after))


@pytest.mark.parametrize(
    ("found", "travel", "worth"),
    [
        (times(4867.0, 4868.0), (9000.0, 8999.0), False),  # 0.0 % less travel, a second longer
        (times(4867.0, 4867.0), (9000.0, 8920.0), False),
        (times(4867.0, 4867.0), (9000.0, 8900.0), True),
        (times(4867.0, 4866.5), (9000.0, 9000.0), False),  # rounding
        (times(4867.0, 4860.0), (9000.0, 9500.0), True),
        (times(100.0, 100.0), (300.0, 294.0), False),  # 2 %, but 6 mm
        (times(100.0, 100.0, retractions=(50, 49)), (300.0, 300.0), True),
        (times(100.0, 100.0, retractions=(500, 498)), (300.0, 300.0), False),
        (times(100.0, 100.0, travel_over_walls_mm=(500.0, 480.0)), (300.0, 300.0), True),
        (times(100.0, 100.0, travel_over_walls_mm=(500.0, 498.0)), (300.0, 300.0), False),
        (times(None, 100.0), (300.0, 300.0), True),  # of a mesh: there is no other file
    ],
)
def test_a_file_is_worth_writing_where_something_falls_that_counts(found, travel, worth):
    """Another file, another risk: nobody takes it for nothing."""
    assert gains(planned(*travel), found) is worth


@pytest.mark.parametrize(("seam", "worth"), [("rear", True), ("aligned", True), ("nearest", False)])
def test_seams_that_were_asked_for_are_a_gain(seam, worth):
    """Who asks for seams at the rear asks for no time."""
    found = times(100.0, 100.0)
    assert gains(planned(300.0, 300.0, freedom="seam", seam=seam), found) is worth


@pytest.mark.parametrize("text", [POOR, GOOD, b"M83\nG1 X1 Y1 E1 F60\nG4 P5000\nG1 X9 E1\nG4 S9\n"])
def test_the_print_never_takes_longer_than_the_whole_file(text):
    """4 869 s of 4 867 s were seen: the plan's own ways from and to its park counted in."""
    found = text_time(text, MotionLimits())
    assert 0.0 < found.print_s <= found.total_s


def test_dwells_between_beads_are_part_of_the_print():
    """Waits for cooling are; those of the end code are not."""
    found = text_time(b"M83\nG1 X1 Y1 E1 F60\nG4 P5000\nG1 X9 E1\nG4 S9\n", MotionLimits())
    assert found.dwell_s == 14.0
    assert found.total_s - found.print_s == pytest.approx(9.0)


@pytest.mark.slow
@pytest.mark.parametrize("text", [POOR, GOOD])
def test_the_summary_states_no_part_longer_than_the_whole(text, tmp_path, capsys):
    """Both are of the written file, by one sum."""
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_bytes(text)
    words = ["-o", str(out), "--time-limit", "0.1", "--no-certificate", "--json"]
    assert run(["plan", str(source), *words]) == 0
    gain = json.loads(capsys.readouterr().out)["gain"]
    for when in ("before", "after"):
        assert gain["print_time_s"][when] <= gain["file_time_s"][when] + 1e-6


@pytest.mark.slow
def test_a_file_with_nothing_to_gain_is_left_and_that_is_said(tmp_path, capsys):
    """One square a layer: no order travels less."""
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_bytes(GOOD)
    assert run(["post", str(source), "--time-limit", "0.1"]) == 0
    assert source.read_bytes() == GOOD
    said = capsys.readouterr().out
    assert "left as it was; nothing to gain" in said
    assert run(["plan", str(source), "-o", str(out), "--time-limit", "0.1"]) == 0
    assert out.read_bytes() == GOOD
    assert "kept the source as it is: nothing to gain" in capsys.readouterr().out
