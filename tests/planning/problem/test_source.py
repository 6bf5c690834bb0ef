"""Commands without `--machine`: the head the file states, or one line on what to do."""

from __future__ import annotations

import json

import pytest
import trimesh

from decmcts.cli.run import run
from decmcts.formats.plans.plan_json import read_plan
from tests.cli.test_bad_input import SQUARE, gcode

CLEARANCES = """
; bed_shape = 0x0,200x0,200x200,0x200
; extruder_clearance_height = 15
; extruder_clearance_radius = 40
; printer_model = Workshop 3
"""


@pytest.fixture(autouse=True)
def _no_slicer(monkeypatch):
    monkeypatch.delenv("SLIC3R_PRINTER_MODEL", raising=False)


@pytest.mark.slow
def test_clearances_serve_plan_post_and_verify(tmp_path, capsys):
    """One head for all three: what was planned for it is judged for it."""
    source, made, plan = tmp_path / "a.gcode", tmp_path / "b.gcode", tmp_path / "p.json"
    source.write_text(gcode(SQUARE) + CLEARANCES)
    words = ["-o", str(made), "--plan", str(plan), "--time-limit", "0.1", "--json"]
    assert run(["plan", str(source), *words]) == 0
    machine = read_plan(plan).machine
    assert json.loads(capsys.readouterr().out)["machine"] == machine.name
    assert [part.height_mm for part in machine.heads[0].slices] == [0.0, 15.0]
    assert run(["verify", str(made), "--source", str(source)]) == 0
    assert "extruder_clearance_radius" in capsys.readouterr().err
    assert run(["post", str(source), "--time-limit", "0.1"]) == 0
    assert "extruder_clearance_radius" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["plan", "post", "verify"])
def test_a_file_that_tells_nothing_is_refused(command, tmp_path, capsys):
    """`paper` is a model of the literature: on a real printer nobody asked for it."""
    source = tmp_path / "part.gcode"
    source.write_text(gcode(SQUARE))
    more = ["--source", str(source)] if command == "verify" else ["--time-limit", "0.1"]
    assert run([command, str(source), *more]) == 2
    (said,) = capsys.readouterr().err.strip().splitlines()[-1:]
    assert "part.gcode" in said
    assert "--machine" in said
    assert "measure-your-head" in said
    assert source.read_text() == gcode(SQUARE)


def test_a_mesh_needs_a_machine(tmp_path, capsys):
    """A mesh knows no printer, so there is no head to prove anything for."""
    source = tmp_path / "part.stl"
    trimesh.creation.box((5, 5, 1)).export(source)
    assert run(["plan", str(source)]) == 2
    assert "--machine" in capsys.readouterr().err


@pytest.mark.parametrize("more", [[], ["--layer-height", "0.2"]])
@pytest.mark.parametrize("name", ["part.step", "part.PLY", "part.glb"])
def test_a_model_of_another_kind_is_called_that(name, more, tmp_path, capsys):
    """It was called G-code with a zero byte, or beads that are printed as they are."""
    source = tmp_path / name
    source.write_bytes(b"ISO-10303-21;\0")
    assert run(["plan", str(source), "--machine", "mk4s", *more]) == 2
    assert f"a {source.suffix.lower()} is not read; export the model as" in capsys.readouterr().err
