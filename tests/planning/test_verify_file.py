"""`decmcts verify OUT.gcode --source IN.gcode`, where OUT is no new order of IN."""

from __future__ import annotations

import json

from decmcts.cli.run import run
from tests.planning.test_verify_plan import TEXT


def test_a_source_that_was_kept_is_no_fault(tmp_path, capsys):
    """`plan -o` copies the source where nothing is faster: its own arcs are no foreign commands."""
    source, kept = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_text(TEXT.replace("G1 X90 Y20 E.4 F1200", "G2 X90 Y20 I0 J5 E.4 F1200"))
    kept.write_bytes(source.read_bytes())
    assert run(["verify", str(kept), "--source", str(source), "--machine", "mk4s"]) == 0
    assert "the file is its source, byte for byte" in capsys.readouterr().err


def test_another_print_is_one_line_and_exit_code_1(tmp_path, capsys):
    """The wrong file named: dozens of missing segments hid that nothing fits at all."""
    source, other = tmp_path / "in.gcode", tmp_path / "other.gcode"
    for path, x in ((source, 20), (other, 80)):
        lines = (f"G1 X{x + k} Y10 F9000\nG1 X{x + k} Y20 E.4 F1200\n" for k in range(30))
        head, end = TEXT.split(";TYPE:Perimeter")[0], "M84\n"
        path.write_text(head + ";TYPE:Perimeter\n" + "".join(lines) + end)
    asked = ["verify", str(other), "--source", str(source), "--machine", "mk4s"]
    assert run(asked) == 1
    said = capsys.readouterr()
    assert said.out.startswith("another print, or the same one moved: 1 of")
    assert said.out.count("\n") == 1 and "1 fault" in said.err
    assert run([*asked, "--json"]) == 1
    assert len(json.loads(capsys.readouterr().out)["faults"]) == 1


def test_remarks_in_the_end_code_are_no_other_end_code(tmp_path, capsys):
    """Packed and unpacked again, a .bgcode has other comments at its end than its source."""
    source, other = tmp_path / "in.gcode", tmp_path / "other.gcode"
    source.write_text(TEXT + "; estimated first layer printing time = 3s\n")
    asked = ["verify", str(other), "--source", str(source), "--machine", "mk4s"]
    for end, code in (("M84\n; one\n; two\n", 0), ("; one\nM84 X\n", 1), ("", 1)):
        other.write_text(TEXT.removesuffix("M84\n") + end)
        assert run(asked) == code
        assert ("end G-code is not" in capsys.readouterr().out) is bool(code)
