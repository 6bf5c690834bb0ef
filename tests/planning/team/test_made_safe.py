"""Parts printed one by one, too near each other, on a machine with several heads."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from decmcts.cli.run import run
from tests.makers.one_by_one import COOLER, one_by_one

TEAM = ["--machine", "dual-gantry"]


@pytest.mark.slow
@pytest.mark.parametrize("later", [("M106 S170",), COOLER], ids=["fan", "temperature"])
def test_launch_begins_with_a_safe_order(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], later: tuple[str, ...]
):
    """Its files pass by the source that was given, which does not pass by itself."""
    source, stem = tmp_path / "in.gcode", tmp_path / "out"
    source.write_text(one_by_one(3, pitch_mm=10.0, later=later))
    files = [str(tmp_path / f"out_{head}.gcode") for head in ("left", "right")]
    plan = str(tmp_path / "plan.json")
    assert run(["verify", str(source), "--source", str(source), *TEAM]) == 1
    capfd.readouterr()
    options = [*TEAM, "--time-limit", "1", "--json", "--plan", plan]
    assert run(["launch", str(source), "-o", str(stem), *options]) == 0
    said = json.loads(capfd.readouterr().out)
    assert said["made_safe"]
    assert said["before"]["made_safe"]
    assert run(["verify", *files, "--source", str(source), *TEAM]) == 0
    assert run(["verify", *files, "--source", str(source), "--plan", plan]) == 0
    assert run(["verify", plan, "--source", str(source)]) == 0


@pytest.mark.slow
def test_launch_refuses_where_a_barrier_leaves_no_order(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    """In one line that names what stands in the way."""
    source = tmp_path / "in.gcode"
    source.write_text(one_by_one(3, ("NEXT_PART",), pitch_mm=10.0))
    assert run(["launch", str(source), "-o", str(tmp_path / "out"), *TEAM]) == 2
    assert "NEXT_PART (unknown macro)" in capfd.readouterr().err
    assert not list(tmp_path.glob("out*"))
