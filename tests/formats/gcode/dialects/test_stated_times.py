"""Progress and times in the words of every slicer: restated, left out, or true of any order."""

from __future__ import annotations

import pytest

from decmcts.formats.gcode.dialects.stated_times import restated, without_progress


def test_what_says_that_all_is_done_stays():
    """100 % is true of any order; any other figure of a verbatim block is not."""
    lines = list(without_progress(b"M73 P100 R0\r\nM73 P7 R3\r\nM400\r\n"))
    assert lines[0] == b"M73 P100 R0\r\n" and lines[2] == b"M400\r\n"
    assert lines[1].startswith(b";") and lines[1].endswith(b"M73 P7 R3\r\n")


@pytest.mark.parametrize(
    ("line", "half"),
    [
        ("; estimated printing time (normal mode) = 1h 24m 3s", "0h 42m 2s"),
        ("; estimated printing time (silent mode) = 1d 2h 3m 4s", "0d 13h 1m 32s"),
        ("; model printing time: 18m 58s; total estimated time: 25m 9s", "9m 29s; total"),
        ("; model printing time: 18m 58s; total estimated time: 25m 10s", "time: 12m 35s"),
        (";TIME:5034", ";TIME:2517"),
        (";TIME_ELAPSED:960.35", ";TIME_ELAPSED:480.18"),
        (";PRINT.TIME:600", ";PRINT.TIME:300"),
        (";Print time: 0 hours 23 minutes", "0 hours 12 minutes"),
        (";   Build time: 1 hour 2 minutes", "0 hour 31 minutes"),
        ("; Estimated Build Time:   12.34 minutes", "6.17 minutes"),
        ("; Total estimated (pre-cool) minutes: 31.26", "15.63"),
        ("; --- print time: 1234s ---", "617s ---"),
        (";Print Time: 1234", "617"),
        (";REMAINING_TIME: 90", "45"),
    ],
)
def test_times_of_every_slicer_are_stated_anew(line, half):
    """In the slicer's own words, so that what reads them still can."""
    assert half in restated(line.encode(), 0.5).decode()


@pytest.mark.parametrize(
    "line",
    [
        "; filament_load_time = 5", "; slowdown_below_layer_time = 5", ";LAYER_COUNT:50",
        "; total layer number: 100", "; Estimated Build Cost:   $1.23", "G1 X5 ; print time: 9",
    ],
)  # fmt: skip
def test_settings_and_counts_stay(line):
    """They are true of any order."""
    assert restated(line.encode(), 0.5).decode() == line


def test_a_first_layers_time_is_left_out():
    """Nobody counted it for the new order."""
    line = restated(b"; estimated first layer printing time (normal mode) = 49s", 0.5)
    assert b"49" not in line and line.startswith(b"; left out")
