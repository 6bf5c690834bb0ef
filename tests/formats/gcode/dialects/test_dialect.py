"""What single lines mean."""

from __future__ import annotations

import pytest

from decmcts.formats.gcode.dialects.dialect import Kind, classify, role_of
from decmcts.print.contours import Role


@pytest.mark.parametrize(
    "line",
    [
        ";LAYER_CHANGE",
        "; CHANGE_LAYER",
        ";LAYER:0",
        ";LAYER:-3",
        "; layer 1, Z = 0.240",
        ";; --- layer 0 (0.250 @ 0.255) ---",
        "; --- Layer Z=0.400 ---",
        "(**** LAYER 3 ****)",
        "; BEGIN_LAYER_OBJECT z=0.28",
    ],
)
def test_layer_marks_of_all_slicers(line):
    """The first mark ends the start G-code; a missed one puts purge lines into the print."""
    assert classify(line.encode()).kind == Kind.LAYER


@pytest.mark.parametrize(
    "line",
    [";LAYER_COUNT:5", ";BEFORE_LAYER_CHANGE", "; layer_height = 0.2", ";AFTER_LAYER_CHANGE"],
)
def test_other_layer_words_are_no_marks(line):
    """Headers and configuration speak of layers too."""
    assert classify(line.encode()).kind != Kind.LAYER


@pytest.mark.parametrize(
    ("line", "role"),
    [
        (";TYPE:External perimeter", Role.EXTERNAL_PERIMETER),
        (";TYPE:WALL-INNER", Role.PERIMETER),
        ("; FEATURE: Sparse infill", Role.INFILL),
        (";TYPE:Wipe tower", Role.WIPE_TOWER),
        ("; feature gap fill", Role.GAP_FILL),
        ("; outer perimeter", Role.EXTERNAL_PERIMETER),
        ("; 'Loop Path', 1.2 [feed mm/s], 30 [head mm/s]", Role.PERIMETER),
        (";TYPE:SKIN", Role.SOLID_INFILL),
        (";TYPE:Overhang wall", Role.OVERHANG_PERIMETER),
    ],
)
def test_roles_of_all_slicers(line, role):
    """Process order and reports speak of roles, one vocabulary."""
    assert classify(line.encode()).slot == "type"
    assert role_of(line) == role


@pytest.mark.parametrize(
    ("line", "slot"),
    [
        ("M106 S127.5", "fan"),
        ("M107", "fan"),
        ("M106 P1 S255", "fan 1"),
        ("M204 P800", "acceleration"),
        ("SET_PRESSURE_ADVANCE ADVANCE=0.04", "pressure advance"),
        ("M900 K0.05", "linear advance"),
        ("M572 D0 S0.04", "pressure advance"),
        ("M221 S95", "flow factor"),
        ("M220 S80", "speed factor"),
        ("M117 Layer 3; of 9", "message"),
        ("EXCLUDE_OBJECT_START NAME=a", "object"),
        ("M486 S2", "object"),
        ("; printing object a id:0 copy 0", "label"),
        ("; start printing object, unique label id: 15", "numbered label"),
        ("M205 X8 Y8", "jerk"),
    ],
)
def test_sticky_commands_are_state(line, slot):
    """Sticky state is put back where it changes in the new order; a barrier would stop all gain."""
    event = classify(line.encode())
    assert (event.kind, event.slot) == (Kind.STATE, slot)


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("M104 S200", "temperature change"),
        ("G10 P0 S200", "temperature change"),
        ("T1", "tool change"),
        ("M600", "filament change"),
        ("M25", "pause"),
        ("G4 P100", "dwell"),
        ("TIMELAPSE_TAKE_FRAME", "unknown macro"),
        ("M1002 judge_flag x", "unknown command"),
        ("G28", "homing"),
        ("M220 B", "unknown command"),
    ],
)
def test_what_is_not_known_to_be_harmless_is_a_barrier(line, reason):
    """Nothing may be moved across a command whose effect is not sticky state."""
    event = classify(line.encode())
    assert (event.kind, event.text) == (Kind.BARRIER, reason)


@pytest.mark.parametrize(
    "line", ["M73 P5 R10", ";TIME_ELAPSED:9", "G92 E0", "G10", "G11", "; words", "N5 G92 E0*21"]
)
def test_progress_and_bookkeeping_mean_nothing(line):
    """They are made anew or dropped."""
    assert classify(line.encode()).kind == Kind.NOTHING


@pytest.mark.parametrize("line", [b"M204 S1e3", b"M106 S2.5e+2", b"M104 S2e2", b"M203 X1 Y5e2"])
def test_exponents_are_refused_where_the_number_counts(line):
    """One firmware reads 1000, another 1, a third 1 and a word E3."""
    assert classify(line).kind == Kind.UNREADABLE
    assert classify(line.replace(b"e", b" E")).kind != Kind.UNREADABLE


@pytest.mark.parametrize("line", [b"M117 1e5 done", b"M486 A part1e5.stl", b"FOO X=1e5", b"; 1e5"])
def test_messages_and_names_may_hold_anything(line):
    """They are no numbers."""
    assert classify(line).kind != Kind.UNREADABLE
