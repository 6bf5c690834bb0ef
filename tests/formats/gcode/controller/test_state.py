"""States of no printer are refused: each would cost more memory than the last."""

from __future__ import annotations

import pytest

from decmcts.errors import InputError
from decmcts.formats.gcode import read_gcode
from decmcts.formats.gcode.controller.state import MOST_SLOTS, MOST_WORDS

START = "G90\nM83\nG1 X1 Y1 Z.2 F900\n"
BEAD = "G1 X9 E1\n"


@pytest.mark.parametrize(
    ("line", "most", "said"),
    [
        ("M106 P{} S9\n", MOST_SLOTS, "settings of a machine"),
        (";Z:{}\n", MOST_WORDS, "layer or object"),
        ("SET_VELOCITY_LIMIT A{}=1\n", MOST_WORDS, "a setting"),
        ("M486 A{}\n", MOST_WORDS, "object"),
    ],
)
def test_more_than_any_machine_has_is_refused_with_its_line(tmp_path, line, most, said):
    """20,000 fans took 5 GB, 10,000 notes of a layer 500 MB."""
    source = tmp_path / "a.gcode"
    head = START + ";LAYER:1\nM486 S0\n"
    body = "".join(line.format(k) for k in range(1, most + 9))
    source.write_text(head + body + BEAD)
    with pytest.raises(InputError, match=said) as caught:
        read_gcode(source)
    first = head.count("\n")
    assert first + most // 2 <= caught.value.line <= first + most + 2
    source.write_text(head + "".join(line.format(k) for k in range(1, most // 2 - 4)) + BEAD)
    assert len(read_gcode(source)[0].contours) == 1


@pytest.mark.parametrize(("line", "tool"), [("T254", 254), ("T255", 3), ("T1000", 3), ("T01", 1)])
def test_above_254_nothing_is_a_tool(tmp_path, line, tool):
    """Start code for Bambu's printers ends with T1000; all contours had been that tool's."""
    source = tmp_path / "a.gcode"
    source.write_text(f"{START}T3\n{line}\n{BEAD}")
    assert read_gcode(source)[0].contours.tool.tolist() == [tool]
