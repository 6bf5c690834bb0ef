"""Commands that make a file mean something else: refused where they count, and only there."""

from __future__ import annotations

import pytest

from decmcts.errors import InputError
from decmcts.formats.gcode.controller.motion import interpret
from decmcts.formats.gcode.text.lines import split_lines

MOVES = "G1 X1 Y1 E1 F600\nG1 X5\n"


def run(text: str) -> None:
    interpret(split_lines(text.encode(), "t"))


@pytest.mark.parametrize(
    "harmless",
    [
        "M117 Printing...\nG5\n" + MOVES,  # Cura's start code of Anycubic's printers
        "G5 ; nothing\nG5*12\ng5\nG5 (bare)\n" + MOVES,
        "G20\nG21\n" + MOVES,
        "G20\nG28\nM104 S200\nG21\n" + MOVES,
        "G16\nG15\nG68\nG69\nG51\nG50\n" + MOVES,
        "G18\nG1 X1 F600\nG17\nG2 X5 I2 J0\n",
        "G19\n" + MOVES,
        MOVES + "G20\nM84\n",
        MOVES + "G18\n",
        "M596 P0\n" + MOVES,
        "M595 P60 Q1\n" + MOVES,
    ],
)
def test_what_is_taken_back_before_anything_moves_is_kept_as_text(harmless):
    """Start and end codes have such lines; nothing of the print is meant in another frame."""
    run(harmless)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("G5 X1 Y1 I0 J3 P0 Q-3\n", r"t:1: Bézier moves \(G5\)"),
        ("G28\nG5 P1\n", r"t:2: Bézier"),
        ("G5.1 X1 I1\n", r"t:1: Bézier"),
        ("G20\n" + MOVES, r"t:1: inches"),
        ("G20\nG92 X1\nG21\n" + MOVES, r"t:1: inches"),
        ("G21\n" + MOVES + "G20\nG1 X0\n", r"t:4: inches"),
        ("G68 R45\n" + MOVES + "G69\n", r"t:1: a rotated frame"),
        ("G16\nG21\n" + MOVES, r"t:1: polar"),
        ("G18\nG2 X5 K2\nG17\n", r"t:1: arcs in the XZ plane"),
        ("G18\nG19\nG2 Y5 K2\nG17\n", r"t:2: arcs in the YZ plane"),
    ],
)
def test_what_is_in_force_where_something_moves_is_refused(text, said):
    """At its own line, not at the first move."""
    with pytest.raises(InputError, match=said):
        run(text)


@pytest.mark.parametrize(
    "line",
    [
        "G91 G1 Z5 F600", "G90G1X5", "M83 G1 X5 E5", "M106 S255 G1 X5", "T0 G1 X5", "G1 Z5 G0 X9",
        "G28 (home) G1 Z5", "N2 G91 G1 Z5*2",
    ],
)  # fmt: skip
def test_a_second_command_in_a_line_is_refused(line):
    """RepRapFirmware makes that move, Marlin and Klipper pass over it: it was lost silently."""
    with pytest.raises(InputError, match="t:2: two commands in a line"):
        run(f"G28\n{line}\n{MOVES}")


@pytest.mark.parametrize(
    "line",
    [
        "M117 G1 Z5", "M118 G1 Z5", 'M98 P"G1.g"', "M900 L1000.0 M1.0", "G1 X5 (G0 X9)",
        "G1 X5 ; G0 X9", 'RESPOND MSG="G1"', "M486 AG1.stl", "G29 P1 ; G1", "N10 G1 X5*33",
        "N3G28", "  n7 g1 x5",
    ],
)  # fmt: skip
def test_what_only_looks_like_a_second_command_is_kept(line):
    """Messages, names and comments hold any words."""
    run(f"{MOVES}{line}\n")


@pytest.mark.parametrize("line", ["M596 P1", "M596P1", "M598", "M606 S1", "M596 P{var.n}"])
def test_a_file_for_several_motion_systems_is_refused_as_that(line):
    """Each system has positions of its own: the moves of one would be taken for the other's."""
    with pytest.raises(InputError, match=r"t:2: a file for several motion systems") as error:
        run(f"M596 P0\n{line}\n{MOVES}")
    assert "decmcts launch" in error.value.advice


@pytest.mark.parametrize(
    ("line", "word", "taken_for"),
    [
        ("G1 C-30 F5400", "C", "a rotary axis"),
        ("G1 X5 A12.5", "A", "an extruder of MakerBot's dialect or a rotary axis"),
        ("g1 x5 b.5", "B", "an extruder of MakerBot's dialect or a rotary axis"),
        ("G0 U10", "U", "a further carriage or axis"),
        ("G1 X1 W3 ; C3", "W", "a further carriage or axis"),
        ("G1 X1 D3", "D", "a further carriage or axis"),
        ("G2 X1 I1 V3", "V", "a further carriage or axis"),
    ],
)
def test_a_further_axis_is_refused_saying_what_it_is_taken_for(line, word, taken_for):
    """ "Export again" does not help whose printer turns the head."""
    with pytest.raises(InputError, match=f"a move has a word {word}, taken for {taken_for};") as at:
        run(f"G28\n{line}\n")
    assert at.value.line == 2
    assert "export the G-code again" not in at.value.advice
