"""`.gcode.3mf` and `.gx` on the command line: read, planned, rewritten in place, verified."""

from __future__ import annotations

import hashlib
import io
import zipfile
from pathlib import Path

import pytest

from decmcts.cli.run import run
from decmcts.formats.gcode.text import flashprint, plates
from tests.formats.gcode.text.packed import BITMAP, GOOD, POOR, gcode_3mf, gx

QUICK = ["--time-limit", "0.1"]


def members(raw: bytes) -> dict[str, bytes]:
    """Return all members of an archive, checked by Python's own reader."""
    with zipfile.ZipFile(io.BytesIO(raw)) as archive:
        assert archive.testzip() is None
        return {name: archive.read(name) for name in archive.namelist()}


def source_of(folder: Path, texts: dict[int, bytes]) -> Path:
    path = folder / "part.gcode.3mf"
    path.write_bytes(gcode_3mf(texts))
    return path


@pytest.mark.slow
def test_plan_writes_the_plate_and_its_checksum_and_leaves_all_else(tmp_path, capsys):
    """What the printer takes; it names its own printer, so no machine is asked for."""
    source, made = source_of(tmp_path, {1: POOR}), tmp_path / "out.gcode.3mf"
    assert run(["plan", str(source), "-o", str(made), *QUICK, "--no-certificate"]) == 0
    assert " on Bambu Lab P1S by its clearances: " in capsys.readouterr().out
    before, after = members(source.read_bytes()), members(made.read_bytes())
    name = "Metadata/plate_1.gcode"
    assert b"reordered by decmcts" in after[name]
    assert after[name].startswith(b"; HEADER_BLOCK_START\n; OrcaSlicer")
    due = hashlib.md5(after[name], usedforsecurity=False).hexdigest().upper()
    assert after[f"{name}.md5"].decode() == due
    changed = {key for key in before if before[key] != after[key]}
    assert list(before) == list(after)
    assert changed == {name, f"{name}.md5"}
    assert run(["verify", str(made), "--source", str(source)]) == 0


@pytest.mark.slow
def test_post_edits_one_plate_in_place_whatever_the_file_is_called(tmp_path):
    """Slicers hand over a temporary copy; the other plate is another print."""
    source = tmp_path / "tmp1234"
    whole = gcode_3mf({1: GOOD, 2: POOR})
    source.write_bytes(whole)
    assert run(["post", str(source), "--plate", "2", *QUICK]) == 0
    made = source.read_bytes()
    assert plates.unpack(made, plate=1) == GOOD
    assert b"reordered by decmcts" in plates.unpack(made, plate=2)
    kept = tmp_path / "whole.gcode.3mf"
    kept.write_bytes(whole)
    check = ["verify", str(source), "--source", str(kept), "--plate", "2"]
    assert run(check) == 0


@pytest.mark.slow
def test_a_plain_name_gives_plain_gcode_that_verifies_against_the_archive(tmp_path):
    """And with the plate of the source named though the result has none."""
    source, made = source_of(tmp_path, {1: GOOD, 3: POOR}), tmp_path / "out.gcode"
    plate = ["--plate", "3"]
    assert run(["plan", str(source), "-o", str(made), *plate, *QUICK, "--no-certificate"]) == 0
    assert made.read_bytes().startswith(b"; HEADER_BLOCK_START")
    assert run(["verify", str(made), "--source", str(source), *plate]) == 0
    assert run(["verify", str(made), "--source", str(source), "--plate", "1"]) == 1


@pytest.mark.slow
def test_a_file_that_is_kept_is_copied_byte_for_byte(tmp_path):
    """One square has no better order."""
    source, made = source_of(tmp_path, {1: POOR}), tmp_path / "out.gcode.3mf"
    args = ["--planner", "slicer", *QUICK, "--no-certificate"]
    assert run(["plan", str(source), "-o", str(made), *args]) == 0
    if plates.unpack(made.read_bytes()) == POOR:
        assert made.read_bytes() == source.read_bytes()


@pytest.mark.slow
def test_flashprint_s_file_keeps_its_header(tmp_path):
    """The printer shows the thumbnail in it."""
    source, made = tmp_path / "part.gx", tmp_path / "out.gx"
    source.write_bytes(gx(POOR))
    assert run(["plan", str(source), "-o", str(made), *QUICK, "--no-certificate"]) == 0
    raw = made.read_bytes()
    assert raw.startswith(b"xgcode 1.0\n\0")
    assert raw[58 : 58 + len(BITMAP)] == BITMAP
    assert b"reordered by decmcts" in flashprint.unpack(raw)
    assert run(["verify", str(made), "--source", str(source)]) == 0


@pytest.mark.parametrize(
    ("texts", "args", "said"),
    [
        ({1: POOR, 2: POOR}, [], "the G-code of plates 1 and 2; add --plate N"),
        ({1: POOR, 2: POOR}, ["--plate", "4"], "plate 4 has no G-code in this file"),
        ({}, [], "no plate in this archive has G-code"),
    ],
)
@pytest.mark.parametrize("command", ["plan", "post", "launch"])
def test_a_plate_that_cannot_be_read_is_refused_in_one_line(command, texts, args, said, tmp_path,
                                                            capsys):  # fmt: skip
    """Nothing is searched, and the file stays."""
    source = source_of(tmp_path, texts)
    before = source.read_bytes()
    assert run([command, str(source), *args]) == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert said in error
    assert source.read_bytes() == before


def test_launch_writes_no_archive(tmp_path, capsys):
    """Each head's controller runs plain G-code."""
    source = source_of(tmp_path, {1: POOR})
    assert run(["launch", str(source), "-o", str(tmp_path / "a.gcode.3mf")]) == 2
    assert "the files of several heads are not written as .3mf" in capsys.readouterr().err


def test_a_plate_of_a_mesh_or_a_plain_file_is_refused(tmp_path, capsys):
    """Only a .gcode.3mf has plates."""
    mesh, plain = tmp_path / "part.stl", tmp_path / "part.gcode"
    mesh.write_bytes(b"solid\nendsolid\n")
    plain.write_bytes(POOR)
    assert run(["plan", str(mesh), "--plate", "1", "--machine", "mk4s"]) == 2
    assert "no plate 1: this is a mesh" in capsys.readouterr().err
    assert run(["plan", str(plain), "--plate", "1"]) == 2
    assert "only a .gcode.3mf has plates" in capsys.readouterr().err
    assert run(["verify", str(plain), "--source", str(plain), "--plate", "1"]) == 2
    assert "only a .gcode.3mf has plates" in capsys.readouterr().err
