"""`.bgcode` on the command line: read, written, rewritten in place, verified."""

from __future__ import annotations

import pytest

from decmcts.cli.run import run
from decmcts.formats.gcode.text.binary import MAGIC, pack, read_blocks, unpack
from tests.formats.gcode.text.test_binary import text

QUICK = ["--time-limit", "0.1"]


@pytest.mark.slow
def test_post_keeps_the_format_of_a_file_without_a_suffix(tmp_path):
    """PrusaSlicer hands over such a file, and uploads what it finds there afterwards."""
    source = tmp_path / "tmp1234"
    whole = pack(text())
    source.write_bytes(whole)
    assert run(["post", str(source), *QUICK, "--allow-slower"]) == 0
    made = source.read_bytes()
    assert made.startswith(MAGIC)
    assert b"reordered by decmcts" in unpack(made)
    assert [b.kind for b in read_blocks(made)] == [b.kind for b in read_blocks(whole)]


@pytest.mark.slow
@pytest.mark.parametrize("begin", ["a.gcode", "a.bgcode"])
@pytest.mark.parametrize("end", ["b.gcode", "b.bgcode"])
def test_the_name_of_the_output_says_how_it_is_written(begin, end, tmp_path):
    """Either kind is made of either, and the judge takes both."""
    source, made = tmp_path / begin, tmp_path / end
    source.write_bytes(text() if begin == "a.gcode" else pack(text()))
    assert run(["plan", str(source), "-o", str(made), *QUICK, "--no-certificate"]) == 0
    assert made.read_bytes().startswith(MAGIC) is (end == "b.bgcode")
    assert run(["verify", str(made), "--source", str(source)]) == 0


def test_a_damaged_file_is_refused_and_left_as_it_was(tmp_path, capsys):
    """The slicer must abort, not upload half a print."""
    source = tmp_path / "part.bgcode"
    cut = pack(text())[:-30]
    source.write_bytes(cut)
    assert run(["post", str(source), *QUICK]) == 2
    assert "part.bgcode: damaged binary G-code" in capsys.readouterr().err
    assert source.read_bytes() == cut


def test_what_cannot_be_packed_is_refused_before_the_search(tmp_path, capsys):
    """Nobody should wait for a search whose result can't be written."""
    source, made = tmp_path / "part.gcode", tmp_path / "out.bgcode"
    source.write_text(";LAYER:0\nG1 X1 E1 F600\nG1 X5 E2\n")
    assert run(["plan", str(source), "-o", str(made), "--machine", "paper"]) == 2
    assert "out.bgcode: this G-code cannot be packed" in capsys.readouterr().err
    assert not made.exists()
