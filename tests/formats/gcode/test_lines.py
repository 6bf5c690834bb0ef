"""The tokenizer: every way to spell a number, and never a crash."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decmcts.errors import InputError
from decmcts.formats.gcode.lines import split_lines
from decmcts.formats.gcode.motion import interpret
from decmcts.formats.gcode.state import track_state


def values(line: str) -> dict[str, float]:
    row = split_lines(line.encode() + b"\n", "t").values[0]
    return {k: v for k, v in zip("XYZEFIJRDS", row.tolist(), strict=True) if not np.isnan(v)}


@pytest.mark.parametrize(
    ("line", "want"),
    [
        ("G1 X1.5 Y-2 E.20854", {"X": 1.5, "Y": -2.0, "E": 0.20854}),
        ("G1X1Y2E3F600", {"X": 1.0, "Y": 2.0, "E": 3.0, "F": 600.0}),
        ("g1 x1 y2", {"X": 1.0, "Y": 2.0}),
        ("N12 G01 X3*57", {"X": 3.0}),
        ("\tG1\tX 4 (to Y9) Z+.5 ; X7", {"X": 4.0, "Z": 0.5}),
        ("G1 X1e-05 Y2", {"X": 1e-05, "Y": 2.0}),
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


@pytest.mark.parametrize("line", ["G1 X1e9", "G1 Y-1000000000", "G1 Z1e300 E1"])
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


@settings(max_examples=200, deadline=None)
@given(st.floats(-9e4, 9e4, allow_nan=False), st.integers(0, 8))
def test_number_equals_python_float(value, places):
    """The fast path must agree with the exact reading of the same text."""
    text = f"{value:.{places}f}"
    got = split_lines(f"G1 X{text}\n".encode(), "t").values[0, 0]
    assert got == pytest.approx(float(re.sub(r"^-0$", "0", text)), abs=1e-11)
