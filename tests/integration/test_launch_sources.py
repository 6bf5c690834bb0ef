"""Sources of every kind for several heads: packed, with arcs and points, with scarf seams."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from decmcts.cli.run import run
from decmcts.experiments.made_print import made_gcode
from tests.formats.gcode.text.packed import gcode_3mf
from tests.makers.scarf import scarf_gcode

pytestmark = pytest.mark.slow

FOUR = [(60.0, 150.0), (110.0, 150.0), (150.0, 150.0), (200.0, 150.0)]


def launched(source: Path, machine: str, *plate: str) -> list[str]:
    """Plan a source for two heads; return the texts of their files, judged in every way."""
    stem, plan = source.parent / "out", source.parent / "plan.json"
    given = ["--machine", machine, *plate]
    options = ["--cut", "none", "--time-limit", "0.3", "--plan", str(plan), "-o", str(stem)]
    assert run(["launch", str(source), *given, *options]) == 0
    names = sorted(str(path) for path in source.parent.glob("out_*.gcode"))
    assert len(names) == 2
    for judged in ([*names, "--plan", str(plan)], names, [str(plan)]):
        assert run(["verify", *judged, "--source", str(source), *given]) == 0
    return [Path(name).read_text() for name in names]


@pytest.mark.usefixtures("agents_here")
def test_a_plate_of_a_packed_file(tmp_path):
    """What Bambu's slicer writes: the plate that was asked for, as files of plain G-code."""
    source = tmp_path / "in.gcode.3mf"
    plates = {1: made_gcode(FOUR[:1]).encode(), 2: made_gcode(FOUR[::3]).encode()}
    source.write_bytes(gcode_3mf(plates))
    assert run(["launch", str(source), "--machine", "dual-gantry", "-o", str(tmp_path / "x")]) == 2
    texts = launched(source, "dual-gantry", "--plate", "2")
    beads = [len(re.findall(r"^G1 X\S+ Y\S+ E", text, re.M)) for text in texts]
    assert sum(beads) == len(re.findall(r"^G1 X\S+ Y\S+ E", made_gcode(FOUR[::3]), re.M))


def test_arcs_and_signals_in_motion(tmp_path):
    """Arcs are shared between the heads, which signal points; each is one arc still."""
    source = tmp_path / "in.gcode"
    source.write_text(made_gcode(FOUR))
    texts = launched(source, "dual-gantry")
    arcs = [len(re.findall(r"^G[23] ", text, re.M)) for text in (*texts, source.read_text())]
    assert arcs[0] + arcs[1] == arcs[2] and min(arcs) > 0
    assert any("SYNC_PASSED" in text for text in texts)


@pytest.mark.usefixtures("agents_here")
def test_scarf_seams(tmp_path):
    """Contacts of the source keep their order and direction, whichever head prints them."""
    source = tmp_path / "in.gcode"
    source.write_text(scarf_gcode([(60.0, 100.0), (100.0, 100.0), (220.0, 100.0)]))
    launched(source, "dual-gantry")


@pytest.mark.usefixtures("agents_here")
def test_a_head_that_prints_nothing_leaves_filament_as_the_start_code_does(tmp_path):
    """The start code pulls more than the first bead pushes; no bead of such a head makes up for it.

    The source ends with nothing retracted.
    """
    source = tmp_path / "in.gcode"
    source.write_text(made_gcode(FOUR[:1]).replace("G1 E-0.80000", "G1 E-1.50000", 1))
    _, right = launched(source, "dual-gantry")
    assert not re.search(r"^G1 X\S+ Y\S+ E", right, re.M)


@pytest.mark.usefixtures("agents_here")
def test_filament_too_little_for_a_stop_is_given_at_the_end(tmp_path):
    """Where nothing is retracted, what single moves push on the spot adds up."""
    source = tmp_path / "in.gcode"
    text = re.sub(r"^G1 E-?0\.80000 F2100\n", "", made_gcode(FOUR), flags=re.M)
    source.write_text(re.sub(r"^(G1 F\d+)$", r"G1 E0.00001 F2100\n\1", text, flags=re.M))
    launched(source, "dual-gantry")
    plan = str(tmp_path / "one.gcode")
    assert run(["plan", str(source), "--machine", "mk4s", "--time-limit", "0.3", "-o", plan]) == 0


@pytest.mark.usefixtures("agents_here")
def test_a_first_bead_too_small_for_what_the_start_code_pulls(tmp_path):
    """A head that begins with it has some retracted still where its next bead begins."""
    source = tmp_path / "in.gcode"
    source.write_text(made_gcode(FOUR[::3]).replace("G1 E-0.80000", "G1 E-11.00000", 1))
    launched(source, "dual-gantry")


@pytest.mark.usefixtures("agents_here")
def test_a_tool_that_pushes_more_at_first_than_was_pulled(tmp_path):
    """Its head waits for the skirt with as little retracted as its first bead leaves it."""
    source = tmp_path / "in.gcode"
    rows = made_gcode(FOUR[::3]).split("\n")
    out, tool, used = list[str](), 0, False
    for row in rows:
        to = re.match(r"G1 X(\S+) Y\S+ F9000", row)
        if to and ";TYPE:Skirt/Brim" not in out[-4:] and (float(to[1]) > 130.0) != tool:
            tool = 1 - tool
            out.append(f"T{tool}")
            if tool and not used:
                out.append("G1 E-0.02000 F2100")
                used = True
        out.append(row)
    source.write_text("\n".join(out))
    plan, stem = str(tmp_path / "plan.json"), str(tmp_path / "out")
    tools = ["--tool", "left=0", "--tool", "right=1", "--machine", "dual-gantry"]
    assert (
        run(["launch", str(source), *tools, "--time-limit", "0.3", "--plan", plan, "-o", stem]) == 0
    )
