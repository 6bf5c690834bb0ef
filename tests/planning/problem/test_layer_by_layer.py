"""Parts printed one by one that the head would hit: a safe order, or a refusal."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from decmcts.cli.run import run
from decmcts.formats.gcode import read_gcode
from decmcts.formats.gcode.text.source_text import load_text
from decmcts.formats.gcode.writing.own_header import SAFE
from decmcts.planning.problem.layer_by_layer import with_epochs
from sim.files.temperatures import in_phases
from tests.formats.gcode.text.packed import gcode_3mf
from tests.makers.one_by_one import BETWEEN, COOLER, one_by_one
from tests.sim.pictures.report.unpacking import page_of

SHORT = ["--planner", "greedy", "--time-limit", "0.2", "--machine", "mk4s", "--no-certificate"]
POST = [option for option in SHORT if option != "--no-certificate"]
MOTION = ("M204 S1000", "M205 X8 Y8", "M201 X1500 Y1500 Z300 E5000", "M203 X200")


@pytest.mark.slow
@pytest.mark.parametrize("n", [2, 3])
def test_they_are_printed_layer_by_layer(tmp_path: Path, capfd: pytest.CaptureFixture[str], n: int):
    """The start is safe and said; the result passes by the file that was given."""
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_text(one_by_one(n, ()))
    given = ["--source", str(source), "--machine", "mk4s"]
    assert run(["verify", str(source), *given]) == 1
    capfd.readouterr()
    report = tmp_path / "report.html"
    plan = ["plan", str(source), "-o", str(out), *SHORT, "--allow-slower"]
    assert run([*plan, "--json", "--report", str(report)]) == 0
    said = json.loads(capfd.readouterr().out)
    assert said["made_safe"]
    assert said["before"]["made_safe"]
    assert page_of(report)["plans"][0]["label"] == "layer by layer"
    header = out.read_text().split("verified: ", 1)[0]
    assert f"; {SAFE}\n" in header
    assert "(layer by layer -> in this order)" in header
    assert any("printed layer by layer instead" in note for note in said["notes"])
    assert run(["verify", str(out), *given]) == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("between", "start"),
    [
        (BETWEEN, ()),
        (("M106 S255", "M107"), ()),
        (MOTION, MOTION),
        (("M220 S100", "M221 S100"), ("M220 S100", "M221 S100")),
        (("G92 E0", "M117 the next part", "M73 P50 R4"), ()),
        (("G1 Z40 F720", "G1 X150 Y150 F9000"), ()),
    ],
    ids=["temperatures", "fan", "motion", "flow", "messages", "a move"],
)
def test_what_slicers_write_between_parts_is_no_barrier(
    tmp_path: Path, between: tuple[str, ...], start: tuple[str, ...]
):
    """What is in force already changes nothing, what holds is set again, the rest is made anew."""
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_text(one_by_one(3, between, start=start))
    assert run(["plan", str(source), "-o", str(out), *SHORT, "--allow-slower"]) == 0
    assert run(["verify", str(out), "--source", str(source), "--machine", "mk4s"]) == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    "label",
    [
        ("M486 S{}", "M486 S-1"),
        ("EXCLUDE_OBJECT_START NAME=t{}", "EXCLUDE_OBJECT_END NAME=t{}"),
        ("; printing object t{}", "; stop printing object t{}"),
    ],
)
def test_labels_of_objects_go_with_their_parts(tmp_path: Path, label: tuple[str, str]):
    """A part that is cancelled is still cancelled alone."""
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_text(one_by_one(2, label=label))
    assert run(["plan", str(source), "-o", str(out), *SHORT, "--allow-slower"]) == 0
    assert run(["verify", str(out), "--source", str(source), "--machine", "mk4s"]) == 0
    assert out.read_text().count(label[0].format(1)) > 1


@pytest.mark.slow
def test_post_does_so_only_when_asked(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    """A script that slicers run unasked changes no order that nobody asked it to change."""
    path = tmp_path / "in.gcode"
    path.write_text(one_by_one(2))
    assert run(["post", str(path), *POST]) == 2
    assert path.read_text() == one_by_one(2)
    assert "--make-safe" in capfd.readouterr().err
    assert run(["post", str(path), *POST, "--make-safe"]) == 0
    assert path.read_text() != one_by_one(2)


@pytest.mark.slow
@pytest.mark.parametrize(
    "barrier", ["M104 S205", "M109 S210", "NEXT_PART", "G28 X Y", "M600", "G4 P500", "M140 S55"]
)
def test_a_barrier_between_parts_leaves_no_order(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], barrier: str
):
    """It is refused in one line, by what stands in the way and where."""
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_text(one_by_one(2, (barrier,)))
    rows = source.read_text().split("\n")
    line = max(k for k, row in enumerate(rows, 1) if row == barrier)
    assert run(["plan", str(source), "-o", str(out), *SHORT]) == 2
    said = [row for row in capfd.readouterr().err.splitlines() if row.startswith("decmcts:")]
    assert len(said) == 1
    assert f"nothing may be moved across line {line}, {barrier} (" in said[0]
    assert not out.exists()


@pytest.mark.slow
def test_a_setting_that_begins_between_parts_leaves_no_order(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    """What held before it cannot be set again."""
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_text(one_by_one(2, ("M204 S500",)))
    assert run(["plan", str(source), "-o", str(out), *SHORT]) == 2
    assert "something is set that nothing has set before" in capfd.readouterr().err


@pytest.mark.slow
def test_contours_keep_the_lines_of_the_file_that_was_given(tmp_path: Path):
    """What was written layer by layer is gone when somebody looks up a line of plan.json."""
    source, plan = tmp_path / "in.gcode", tmp_path / "plan.json"
    source.write_text(one_by_one(2))
    assert run(["plan", str(source), "--plan", str(plan), *SHORT]) == 0
    rows = source.read_text().split("\n")
    lines = [contour["line"] for contour in json.loads(plan.read_text())["contours"]]
    begins = [k for k, row in enumerate(rows, 1) if " E0.2" in row and " E" not in rows[k - 2]]
    assert sorted(lines) == begins
    assert lines != begins


def test_parts_that_begin_anew_have_no_second_layer_for_all(tmp_path: Path):
    """The fan of the first part's second layer parts nothing: the next part begins without it."""
    path = tmp_path / "in.gcode"
    path.write_text(one_by_one(2, later=("M106 S170",)))
    assert read_gcode(path)[0].contours.epoch.max() == 0
    path.write_text(one_by_one(1, later=("M106 S170",)))
    assert read_gcode(path)[0].contours.epoch.max() == 1


def test_nothing_crosses_what_it_may_not_in_the_source(tmp_path: Path):
    """What the layered file parts is parted, and so is what the source parts."""
    path = tmp_path / "in.gcode"
    path.write_text(one_by_one(1, later=("M106 S170",), start=("M204 S900",)))
    job, document = read_gcode(path)
    own = np.repeat(np.arange(5), 2).astype(np.int32)  # a layer each
    job, document = with_epochs(job, document, own)
    assert job.contours.epoch.tolist() == own.tolist()
    job, _ = with_epochs(job, document, np.zeros(10, np.int32))
    assert job.contours.epoch.tolist() == own.tolist()


@pytest.mark.slow
@pytest.mark.parametrize("bed", [False, True])
def test_first_layers_of_another_temperature_are_printed_together(tmp_path: Path, bed: bool):
    """As slicers' profiles have it; the temperature is set once, and right for each bead."""
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    later = ("M140 S55", *COOLER) if bed else COOLER
    source.write_text(one_by_one(3, later=later))
    assert run(["plan", str(source), "-o", str(out), *SHORT, "--allow-slower"]) == 0
    assert run(["verify", str(out), "--source", str(source), "--machine", "mk4s"]) == 0
    rows = out.read_text().split("\n")
    assert rows.count("M104 S205") == 1
    assert sum(row.startswith("M104 S210") for row in rows) == 1  # the start code's


def test_temperatures_of_a_tower_are_no_phases_of_parts(tmp_path: Path):
    """A print that comes down nowhere is one part: it is as hot as it was where it was."""
    path = tmp_path / "in.gcode"
    text, calls = one_by_one(1, layers=4), iter(("M104 S205", "M104 S210", "M104 S205"))
    parts = text.split(";LAYER_CHANGE\n")
    body = "".join(f"{next(calls)}\n;LAYER_CHANGE\n{part}" for part in parts[2:])
    path.write_text(";LAYER_CHANGE\n".join(parts[:2]) + body)
    job, document = read_gcode(path)
    assert job.contours.epoch.max() == 3
    assert in_phases(job, document) is None


@pytest.mark.slow
def test_parts_one_by_one_as_cura_writes_them(tmp_path: Path):
    """Its layers begin at 0 again with each part, and the fan is off between them."""
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    text = one_by_one(3, ("M107", "G0 F9000 X60 Y60 Z20"), label=(";MESH:t{}.stl", ";MESH:NONMESH"))
    text = text.replace("; generated by PrusaSlicer 2.7.4 on 2024-01-01", ";FLAVOR:Marlin")
    layers = iter([f";LAYER:{k}" for k in range(5)] * 3)
    rows = text.replace("External perimeter", "WALL-OUTER").split("\n")
    rows = [next(layers) if row == ";LAYER_CHANGE" else row for row in rows]
    rows = [row for row in rows if not row.startswith((";Z:", ";HEIGHT:", ";WIDTH:"))]
    source.write_text(";Generated with Cura_SteamEngine 5.6.0\n" + "\n".join(rows))
    assert run(["plan", str(source), "-o", str(out), *SHORT, "--allow-slower"]) == 0
    assert run(["verify", str(out), "--source", str(source), "--machine", "mk4s"]) == 0


@pytest.mark.slow
def test_pillars_near_each_other_are_refused_as_what_they_are(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    """A vertical bead is printed whole: a head as wide as their distance cannot do two."""
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    pillar = "G1 X{} Y60 F8000\nG1 Z0.5\nG1 X{} E0.5 F1000\nG1 Z6 E1.2 F200\nG1 Z8 F8000\n"
    pillars = "".join(pillar.format(x, x + 3) for x in (20, 30, 40))
    source.write_text("M104 S210\nG28\nG90\nM83\n" + pillars + "M104 S0\nM84\n")
    assert run(["plan", str(source), "-o", str(out), *SHORT]) == 2
    said = capfd.readouterr().err
    assert "line 7 climbs from z 0.500 to 6.000 mm in one piece, which no order splits" in said


@pytest.mark.slow
def test_an_unsafe_source_is_never_kept(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    """Be the new order no faster than layer by layer: what was given hits the part."""
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_text(one_by_one(2, layers=2))
    short = ["--planner", "slicer", *SHORT[2:]]
    assert run(["plan", str(source), "-o", str(out), *short, "--json"]) == 0
    said = json.loads(capfd.readouterr().out)
    assert not said["kept_source"]
    assert run(["verify", str(out), "--source", str(source), "--machine", "mk4s"]) == 0


@pytest.mark.slow
def test_the_plate_of_an_archive_is_made_safe_in_its_place(tmp_path: Path):
    """The other plate stays as it is."""
    source, out = tmp_path / "in.gcode.3mf", tmp_path / "out.gcode.3mf"
    source.write_bytes(gcode_3mf({1: one_by_one(1).encode(), 2: one_by_one(2).encode()}))
    assert run(["plan", str(source), "-o", str(out), *SHORT, "--plate", "2"]) == 0
    assert load_text(out, 1) == load_text(source, 1)
    assert load_text(out, 2) != load_text(source, 2)
    given = ["--source", str(source), "--machine", "mk4s", "--plate", "2"]
    assert run(["verify", str(out), *given]) == 0
