"""The experiment runs from file to table on a print small enough for a test."""

from __future__ import annotations

import csv

import pytest

from sim.experiments import two_heads


def gcode(towers, layers=3) -> str:
    lines = ["M83", "G28"]
    for k in range(layers):
        z = 0.2 * (k + 1)
        lines += [";LAYER_CHANGE", f";Z:{z:.2f}", ";HEIGHT:0.2"]
        for x, y in towers:
            lines += [
                f"G1 Z{z:.2f} F600",
                f"G1 X{x} Y{y} F6000",
                ";TYPE:External perimeter",
                ";WIDTH:0.45",
            ]
            lines += [
                f"G1 X{x + dx} Y{y + dy} E0.4 F1200" for dx, dy in ((9, 0), (9, 9), (0, 9), (0, 0))
            ]
    return "\n".join([*lines, "G1 Z20 F600", "M84", ""])


@pytest.mark.slow
def test_from_file_to_table(tmp_path, capsys):
    """Two towers far apart: the team is faster than one head, and the judge finds nothing."""
    source = tmp_path / "towers.gcode"
    source.write_text(gcode([(40.0, 100.0), (240.0, 100.0)], layers=30))
    code = two_heads.main(
        [str(source), "--time-limit", "0.2", "--trials", "1", "--out", str(tmp_path / "out")]
    )
    assert code == 0
    table = (tmp_path / "out" / "two_heads.csv").read_text(encoding="utf-8")
    (row,) = csv.DictReader(table.splitlines())
    assert float(row["faster"]) > 1.3
    assert float(row["over_bound"]) >= 1.0
    assert row["contacts"] == row["faults"] == "0"
    assert (tmp_path / "out" / "towers.png").exists()
    assert "towers" in capsys.readouterr().out


def test_a_missing_file_is_one_line(tmp_path, capsys):
    """Bad input ends with a line and a code, not a trace."""
    missing = str(tmp_path / "none.gcode")
    assert two_heads.main([missing, "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err.startswith("decmcts: ")
