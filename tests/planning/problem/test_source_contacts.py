"""Prints whose source touches itself, from file to file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from decmcts.cli.run import run
from tests.makers.scarf import scarf_gcode

CENTRES = [(60.0, 60.0), (130.0, 60.0), (60.0, 130.0), (130.0, 130.0)]
SHORT = ["--planner", "greedy", "--time-limit", "0.2", "--no-certificate", "--allow-slower"]


@pytest.mark.slow
@pytest.mark.parametrize("machine", ["mk3s", "voron24-300"])
def test_scarf_seams_are_planned_and_pass_both_judges(
    tmp_path: Path, machine: str, capfd: pytest.CaptureFixture[str]
):
    """A default of today's slicers: on every machine planned, said once, and verified."""
    source, out, plan = (str(tmp_path / name) for name in ("in.gcode", "out.gcode", "plan.json"))
    Path(source).write_text(scarf_gcode(CENTRES))
    named = ["--machine", machine]
    assert run(["plan", source, "-o", out, "--plan", plan, *named, *SHORT, "--json"]) == 0
    said = json.loads(capfd.readouterr().out)
    assert len([note for note in said["notes"] if "by up to 0.100 mm" in note]) == 1
    if machine == "mk3s":  # towers beyond each other's reach
        assert said["after"]["extrusionless_travel_mm"] < said["before"]["extrusionless_travel_mm"]
    assert run(["verify", out, "--source", source, *named]) == 0
    assert run(["verify", plan, "--source", source, *named]) == 0
    assert run(["verify", plan]) == 0


@pytest.mark.slow
def test_a_plan_with_a_ramp_before_its_wall_does_not_pass(tmp_path: Path):
    """The judge finds the pair anew: the plan's own pairs and flags are not believed."""
    source, plan = tmp_path / "in.gcode", tmp_path / "plan.json"
    source.write_text(scarf_gcode(CENTRES[:1]))
    assert run(["plan", str(source), "--plan", str(plan), "--machine", "mk3s", *SHORT]) == 0
    spoilt = json.loads(plan.read_text())
    actions = spoilt["heads"][0]["actions"]
    wall, ramp = (next(k for k, a in enumerate(actions) if a["contour"] == c) for c in (0, 1))
    for k in (wall, ramp):
        assert actions[k]["kind"] == "print"
    ramp_contour = spoilt["contours"][1]
    ramp_contour["reversible"] = True
    actions[ramp]["reversed"] = True
    actions[ramp]["path"].reverse()
    spoilt["precedence"] = []
    plan.write_text(json.dumps(spoilt))
    assert run(["verify", str(plan), "--source", str(source), "--machine", "mk3s"]) == 1
