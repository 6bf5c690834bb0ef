"""A print that takes longer is no gain: the source is kept unless the slower one is asked for."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import pytest

from decmcts.cli.run import run
from decmcts.formats.plans.plan_json import read_plan
from sim.verify import verify_plan
from tests.cli.test_bad_input import TAIL, gcode
from tests.makers.corpus import CORPUS

COMBED = CORPUS / "gcode/cura_5.3.1_marlin_lightning.gcode.gz"
WORDS = ["--machine", "paper", "--time-limit", "0.2", "--max-layers-ahead", "0"]


def combed(layers: int = 8) -> str:
    """Four walls a layer, 20 mm apart: all but one travel bare, the shortest one retracted.

    Such a source shows a habit of retracting, but is quicker than any order that retracts
    every long travel.
    """
    text = ""
    for layer in range(layers):
        z = 0.2 * (layer + 1)
        text += f";LAYER_CHANGE\nG1 Z{z:.1f} F7800\n"
        for x in (100, 120, 140, 160) if layer % 2 == 0 else (160, 140, 120, 100):
            text += f"G1 X{x} Y100 F7800\nG1 X{x} Y110 E.4 F1800\n"
        text += "G1 E-4 F600\n" + f"G1 X{x} Y107 F7800\nG1 E4 F600\nG1 X{x + 8} Y107 E.3 F1800\n"
    return gcode(text).replace(TAIL, "") + TAIL


@pytest.mark.shared
@pytest.mark.slow
@pytest.mark.skipif(not COMBED.exists(), reason="the corpus of real prints is not here")
def test_a_source_of_cura_is_not_retracted_more_for_being_reordered(tmp_path, capsys):
    """It retracts 3 times in 1 464 contours; a result that did so at every layer took longer."""
    words = ["--machine", "mk4s", "--objective", "time", "--time-limit", "2", "--no-certificate"]
    out = tmp_path / "out.gcode"
    assert run(["plan", str(COMBED), *words, "-o", str(out), "--json"]) == 0
    counts = json.loads(capsys.readouterr().out)["gain"]["retractions"]
    assert counts["before"] == 3
    assert counts["after"] <= 10


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "part.gcode"
    path.write_text(combed())
    return path


def test_post_leaves_a_file_alone_that_would_grow(source, capsys):
    """A slicer's export must neither fail nor print for longer than without us."""
    before = source.read_bytes()
    assert run(["post", str(source), *WORDS]) == 0
    said = capsys.readouterr().out
    assert source.read_bytes() == before
    assert len(said.splitlines()) == 1
    assert "left as it was" in said
    assert "--allow-slower" in said


def test_post_in_json_says_that_the_source_was_kept(source, capsys):
    """Programs read a key, not a sentence."""
    assert run(["post", str(source), *WORDS, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["kept_source"] is True
    assert said["written"] == []
    assert said["file_time_s"]["after"] == said["file_time_s"]["before"]


def test_plan_copies_the_source_and_describes_its_own_order(source, tmp_path, capsys):
    """A chain of commands finds the output it asked for; plan.json must tell the same story."""
    out, plan = tmp_path / "out.gcode", tmp_path / "plan.json"
    words = ["plan", str(source), "-o", str(out), "--plan", str(plan), *WORDS, "--json"]
    assert run(words) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["kept_source"] is True
    assert out.read_bytes() == source.read_bytes()
    document = read_plan(plan)
    printed = document.plan.heads[0].contour
    assert printed[printed >= 0].tolist() == sorted(printed[printed >= 0].tolist())
    assert document.metrics["kept_source"] is True
    assert "--allow-slower writes it all the same" in document.metrics["kept_because"]
    assert verify_plan(document).ok


def test_a_packed_source_is_unpacked_where_the_output_is_not_packed(source, tmp_path):
    """A printer cannot read gzip under the name of G-code."""
    packed, out = tmp_path / "packed.gcode.gz", tmp_path / "out.gcode"
    packed.write_bytes(gzip.compress(source.read_bytes()))
    assert run(["plan", str(packed), "-o", str(out), *WORDS]) == 0
    assert out.read_bytes() == source.read_bytes()


def test_a_kept_source_without_a_suffix_goes_to_standard_output(
    source, tmp_path, monkeypatch, capfdbinary
):
    """It went to a file named `-`."""
    monkeypatch.chdir(tmp_path)
    plain = source.rename(tmp_path / "part")
    assert run(["plan", str(plain), "-o", "-", *WORDS]) == 0
    assert plain.read_bytes() in capfdbinary.readouterr().out
    assert not (tmp_path / "-").exists()


def test_a_slower_file_is_written_when_asked_for(source, tmp_path, capsys):
    """Less travel may be worth more than time, to its owner."""
    out = tmp_path / "out.gcode"
    words = ["plan", str(source), "-o", str(out), *WORDS, "--allow-slower", "--json"]
    assert run(words) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["kept_source"] is False
    assert said["file_time_s"]["after"] > said["file_time_s"]["before"] + 1.0
    assert b"reordered by decmcts" in out.read_bytes()


def test_a_quicker_file_is_written(tmp_path, capsys):
    """Where the new order saves time nothing is held back."""
    lines = "".join(
        f"G1 X{x} Y100 F7800\nG1 X{x} Y110 E.4 F1800\n" for x in (100, 160, 120, 180, 140, 200)
    )
    source, out = tmp_path / "part.gcode", tmp_path / "out.gcode"
    source.write_text(gcode(lines))
    assert run(["plan", str(source), "-o", str(out), *WORDS, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["kept_source"] is False
    assert said["file_time_s"]["after"] < said["file_time_s"]["before"]
