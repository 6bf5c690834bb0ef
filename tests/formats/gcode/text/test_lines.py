"""The tokenizer: every way to spell a number, and never a crash."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decmcts.errors import InputError
from decmcts.formats.gcode.controller.motion import interpret
from decmcts.formats.gcode.controller.state import track_state
from decmcts.formats.gcode.text.lines import command_of, split_lines


def values(line: str) -> dict[str, float]:
    row = split_lines(line.encode() + b"\n", "t").values[0]
    return {k: v for k, v in zip("XYZEFIJRDSP", row.tolist(), strict=True) if not np.isnan(v)}


@pytest.mark.parametrize(
    ("line", "want"),
    [
        ("G1 X1.5 Y-2 E.20854", {"X": 1.5, "Y": -2.0, "E": 0.20854}),
        ("G1X1Y2E3F600", {"X": 1.0, "Y": 2.0, "E": 3.0, "F": 600.0}),
        ("g1 x1 y2", {"X": 1.0, "Y": 2.0}),
        ("N12 G01 X3*57", {"X": 3.0}),
        ("\tG1\tX 4 (to Y9) Z+.5 ; X7", {"X": 4.0, "Z": 0.5}),
        ("g1x1e-5", {"X": 1.0, "E": -5.0}),
        ("G1 X5. Y-.25\r", {"X": 5.0, "Y": -0.25}),
        ("G1 X0.123456789012345678901", {"X": 0.12345678901234568}),
    ],
)
def test_numbers_as_firmware_reads_them(line, want):
    """Slicers drop zeros, blanks and case; a misread number is a wrecked print."""
    got = values(line)
    assert got.keys() == want.keys()
    assert all(abs(got[k] - want[k]) < 1e-15 for k in want)


@pytest.mark.parametrize(
    "line", ["G1 X", "G1 X1 Y", "G1 Xnan Y2", "G1 X1.2.3", "G1 X1 ?", "G1 Xinf"]
)
def test_damaged_line_is_named(line):
    """A truncated line must stop the reader, with its number."""
    with pytest.raises(InputError) as error:
        split_lines(f"G28\n{line}\n".encode(), "t.gcode")
    assert error.value.line == 2


@pytest.mark.parametrize("line", ["G1 X1000000000", "G1 Y-1000000000", "G1 Z%s E1" % ("9" * 300)])
def test_coordinate_out_of_range_is_refused(line):
    """A coordinate no printer has is damage, not a place."""
    with pytest.raises(InputError, match="beyond"):
        split_lines(line.encode(), "t.gcode")


def test_file_cut_mid_number_is_refused():
    """A copy that stopped half way must not become a shorter print."""
    with pytest.raises(InputError, match="middle of a line"):
        split_lines(b"G1 X1 Y1\nG1 X12.", "t.gcode")


@settings(max_examples=300, deadline=None)
@given(
    st.one_of(
        st.binary(max_size=200),
        st.text(alphabet="GMTXYZEFIJRN0123456789.-+ ;()*\n\r\te", max_size=200),
    )
)
def test_scanner_never_raises_anything_else(text):
    """Hostile bytes give an InputError or lines, nothing else."""
    raw = text if isinstance(text, bytes) else text.encode()
    try:
        lines = split_lines(raw, "t")
        track_state(lines, interpret(lines))
    except InputError:
        pass


@pytest.mark.parametrize(
    ("line", "what"),
    [
        ("G1 X1e5", "a number with an exponent"),
        ("G1 X1e-05 Y2", "a number with an exponent"),
        ("G92 E1.e+5", "a number with an exponent"),
        ("g1 e1e5", "a number with an exponent"),
        ("G1 X1 X2", "a word that stands twice"),
        ("g1 x1 Y2 X2", "a word that stands twice"),
        ("G1X1E1E2", "a word that stands twice"),
        ("G3 X1 I1 I2", "a word that stands twice"),
        ("G1 X100000", "a coordinate beyond ±10000"),
        ("G1 X" + "7" * 5000, "a coordinate beyond ±10000"),
        ("G1 Y-10000.1", "a coordinate beyond ±10000"),
        ("G1 X1 E1" + "0" * 300, "an amount of filament beyond"),
        ("G1 X1 F" + "9" * 400, "a feed beyond"),
        ("G2 X1 I" + "9" * 20, "the centre of an arc beyond"),
        ("M83\nG1 X1 E5000000", "more than 1e.06 mm of filament in one move"),
        ("G91\n" + "G1 X9000\n" * 2, "relative moves that leave ±10000 mm"),
    ],
)
def test_numbers_no_printer_knows_are_refused(line, what):
    """A coordinate of 100 m once took 23 GB of memory; its line and the limit are named."""
    with pytest.raises(InputError, match=what):
        interpret(split_lines(f"{line}\n".encode(), "t"))


def test_a_line_of_megabytes_is_read_like_any_other():
    """Memory goes with the size of the file, not with the length of a line."""
    lines = split_lines(b"G1 X1 " + b"; " + b"x" * 2**22 + b"\nG1 X2\n", "t")
    assert lines.values[:, 0].tolist() == [1.0, 2.0]


@settings(max_examples=200, deadline=None)
@given(st.floats(-9999, 9999, allow_nan=False), st.integers(0, 8))
def test_number_equals_python_float(value, places):
    """The fast path must agree with the exact reading of the same text."""
    text = f"{value:.{places}f}"
    got = split_lines(f"G1 X{text}\n".encode(), "t").values[0, 0]
    assert got == pytest.approx(float(re.sub(r"^-0$", "0", text)), abs=1e-11)


@pytest.mark.parametrize(
    "row",
    [
        "G1 X9 (half E.5 F900",
        "G1 X5 (a;b)",
        "G92 (x E0",
        "G1 X9 (a (b) E.5",
        "G1 X9 (((a)",
    ],
)
def test_a_bracket_that_stays_open_is_refused(row):
    """Firmwares differ in what it hides: the E behind it would be lost in silence here."""
    with pytest.raises(InputError, match="bracket") as caught:
        split_lines(f"G28\n{row}\n".encode(), "x")
    assert caught.value.line == 2


@pytest.mark.parametrize("row", ["(note", "M117 (x", "G1 X9 (a) E.5", "G1 X1 ; (b", "; (c"])
def test_brackets_that_hide_nothing_are_fine(row):
    """Messages, comments and closed brackets mean the same to all."""
    assert len(split_lines(f"G28\n{row}\n".encode(), "x")) == 2


@pytest.mark.parametrize(
    ("line", "command"),
    [
        ("M104S210T1", "M104 S210 T1"),
        ("g1x-1.5e.2 ; purge", "g1 x-1.5 e.2"),
        ("  M104  S210\tT1 ;hot", "M104 S210 T1"),
        ("T1", "T1"),
        ("SET_PIN PIN=fan1b", "SET_PIN PIN=fan1b"),
        ("M73P5R30", ""),
        (";G1X1", ""),
    ],
)
def test_a_command_is_the_same_with_blanks_and_without(line: str, command: str) -> None:
    assert command_of(line.encode()) == command.encode()
