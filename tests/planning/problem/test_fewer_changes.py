"""One head with several tools: fewer changes where they follow one pattern, else a reason."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from decmcts.cli.run import run
from tests.makers.changes import EXTRA_MM, two_colours

SHORT = ["--planner", "greedy", "--time-limit", "0.2", "--machine", "mk4s", "--no-certificate"]


def planned(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], text: str, *more: str
) -> tuple[dict, str]:
    """Plan a source; return what was said and the file, verified against the source."""
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_text(text)
    assert run(["plan", str(source), "-o", str(out), *SHORT, "--json", *more]) == 0
    said = json.loads(capfd.readouterr().out)
    assert run(["verify", str(out), "--source", str(source), "--machine", "mk4s"]) == 0
    return said, out.read_text()


def filament(text: str) -> dict[int, float]:
    """Return what each tool gives in all, mm, counted line by line."""
    given, tool = {0: 0.0, 1: 0.0}, 0
    for row in text.splitlines():
        code = row.split(";")[0]
        if chosen := re.match(r"T(\d)", code):
            tool = int(chosen[1])
        if pushed := re.match(r"G1 .*E(-?[\d.]+)", code):
            given[tool] += float(pushed[1])
    return given


@pytest.mark.slow
def test_changes_fall_to_a_fifth_and_time_falls(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    """Four parts of two colours, no tower; what primes a tool is pushed at each change alone."""
    text = two_colours()
    said, out = planned(tmp_path, capfd, text, "--report", str(tmp_path / "report.html"))
    was, now = (said[key]["tool_changes"] for key in ("before", "after"))
    assert (was, now) == (12, 2) == (text.count("\nT") - 1, out.count("\nT") - 1)
    assert said["file_time_s"]["after"] < said["file_time_s"]["before"]
    assert said["gain"]["emitted_travel_mm"]["less_percent"] > 30.0
    due, has = filament(text), filament(out)
    gone = {tool: sum(f"E{10.0 + EXTRA_MM[tool]:.5f}" in row for row in text.splitlines())
            - sum(f"E{10.0 + EXTRA_MM[tool]:.5f}" in row for row in out.splitlines())
            for tool in (0, 1)}  # fmt: skip
    assert gone == {0: 6, 1: 4} or sum(gone.values()) == 10
    for tool in (0, 1):
        assert has[tool] == pytest.approx(due[tool] - gone[tool] * EXTRA_MM[tool], abs=1e-4)


@pytest.mark.slow
def test_a_print_with_a_tower_is_left_as_it_is_and_that_is_said(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    """Its beads keep their places, and so do the changes."""
    source = tmp_path / "in.gcode"
    source.write_text(two_colours(tower=True))
    assert run(["plan", str(source), "-o", str(tmp_path / "out.gcode"), *SHORT]) == 0
    assert "changes of tools stay as they are: a wipe tower" in capfd.readouterr().err
    tools = [re.findall(r"^T\d", (tmp_path / name).read_text(), re.M)
             for name in ("in.gcode", "out.gcode")]  # fmt: skip
    assert tools[0] == tools[1]


@pytest.mark.slow
def test_a_change_unlike_the_others_stays_where_it_is(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    """Nothing moves across it; before and behind it tools change less often."""
    said, out = planned(tmp_path, capfd, two_colours(odd=5))
    assert said["after"]["tool_changes"] == 6
    assert any("2 changes of tools stay where they are" in note for note in said["notes"])
    assert out.count("G4 P700") == 1


@pytest.mark.slow
def test_parts_too_near_each_other_change_tools_as_they_did(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    """The head would hit the one that is a layer ahead."""
    near = [(100.0, 100.0, 0), (120.0, 100.0, 1)]
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_text(two_colours(near))
    assert run(["plan", str(source), "-o", str(out), *SHORT]) == 0
    assert "no order that the rules allow has fewer" in capfd.readouterr().err
    assert out.read_text().count("\nT") == source.read_text().count("\nT")


@pytest.mark.slow
def test_waits_for_cooling_count_by_the_source_that_was_given(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    """A part alone is printed over as late as beside the others, by waits; or changes stay."""
    said, _ = planned(tmp_path, capfd, two_colours(), "--min-layer-time", "7")
    assert said["after"]["tool_changes"] == 2
    assert said["after"]["waits_s"] > 5.0
    _, out = planned(tmp_path, capfd, two_colours(), "--min-layer-time", "60")
    assert out.count("\nT") == two_colours().count("\nT")


@pytest.mark.slow
def test_its_plan_is_known_as_the_source_s(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    """plan.json numbers contours by another order than the source, which was taken for faults."""
    plan, left, source = (str(tmp_path / name) for name in ("plan.json", "left.json", "in.gcode"))
    said, _ = planned(tmp_path, capfd, two_colours(), "--plan", plan)
    assert said["after"]["tool_changes"] == 2
    assert run(["verify", plan, "--source", source]) == 0
    capfd.readouterr()
    assert run(["replan", plan, "--source", source, "--layer", "1", "--plan", left]) == 2
    line = capfd.readouterr().err.strip().splitlines()[-1]
    assert "in.gcode: these lines move the head" in line
