"""Motion limits that files state, in settings and in commands."""

from __future__ import annotations

import math

import numpy as np
import pytest

from decmcts.formats.gcode.controller.limits import parameters, state_limits, stated_limits
from decmcts.formats.gcode.controller.motion import interpret
from decmcts.formats.gcode.controller.state import track_state
from decmcts.formats.gcode.text.lines import split_lines
from decmcts.print import motion_kernels as columns
from decmcts.print.machine import MotionLimits

USUAL = MotionLimits()
SETTINGS = b"""; gcode_flavor = marlin2
; machine_limits_usage = time_estimate_only
; machine_max_acceleration_e = 10000,5000
; machine_max_acceleration_extruding = 1500,1250
; machine_max_acceleration_retracting = 1400,1250
; machine_max_acceleration_travel = 1700,1250
; machine_max_acceleration_x = 9000,1000
; machine_max_feedrate_x = 500,200
; machine_max_jerk_x = 10,10
; machine_max_jerk_z = 0
"""


def row_after(text: str, limits: MotionLimits = USUAL, **options) -> np.ndarray:
    """Return the limits in force below some commands."""
    lines = split_lines((text + "\nG1 X1 F600\n").encode(), "test.gcode")
    track = track_state(lines, interpret(lines))
    return state_limits(track.table, limits, **options)[int(track.at(len(lines) - 1))]


def test_settings_of_the_normal_mode_are_read():
    """PrusaSlicer lists normal and silent mode; the first is what a print runs in."""
    said = stated_limits(SETTINGS)
    assert said.max_feed[0] == 500.0 and math.isnan(said.max_feed[1])
    assert said.max_acceleration[0] == 9000.0 and said.max_acceleration[3] == 10000.0
    assert (said.acceleration, said.retract_acceleration) == (1500.0, 1400.0)
    assert said.travel_acceleration == 1700.0
    assert said.jerk[0] == 10.0 and said.jerk[2] == 0.0


def test_legacy_marlin_travels_as_it_prints():
    """The old flavour has no travel acceleration of its own."""
    text = SETTINGS.replace(b"marlin2", b"marlin")
    assert stated_limits(text).travel_acceleration == 1500.0


def test_ignored_settings_are_ignored():
    """A profile that says its limits mean nothing is taken at its word."""
    said = stated_limits(SETTINGS.replace(b"time_estimate_only", b"ignore"))
    assert USUAL.under(said) == USUAL


@pytest.mark.parametrize(
    ("command", "column", "value"),
    [
        ("M201 X7000 Y6000 Z200 E2500", columns.ACCELERATION + 1, 6000.0),
        ("M203 X400 Y350 Z12 E100", columns.FEED + 2, 12.0),
        ("M203 X30000 Y30000 Z900", columns.FEED + 2, 15.0),  # RepRapFirmware: mm/min
        ("M204 P800 R1200 T2500", columns.PRINTING, 800.0),
        ("M204 P800 R1200 T2500", columns.RETRACTING, 1200.0),
        ("M204 P800 R1200 T2500", columns.TRAVELLING, 2500.0),
        ("M204 S900", columns.PRINTING, 900.0),
        ("M204 S900", columns.TRAVELLING, 900.0),
        ("M204 S900 T700", columns.RETRACTING, 700.0),
        ("M205 X9 Z0.4", columns.JERK + 1, 9.0),  # Y follows X
        ("M205 X9 Z0.4", columns.JERK + 2, 0.4),
        ("M205 J0.02", columns.DEVIATION, 0.02),
        ("M566 X600 Y480", columns.JERK + 1, 8.0),
        ("M220 S50", columns.FACTOR, 0.5),
        ("SET_VELOCITY_LIMIT ACCEL=4000", columns.TRAVELLING, 4000.0),
        ("SET_VELOCITY_LIMIT VELOCITY=250", columns.FEED, 250.0),
        ("M204 P1000\nM204 P600", columns.PRINTING, 600.0),  # the last counts
    ],
)
def test_commands_set_limits(command, column, value):
    """Each command, and the parameters it leaves alone."""
    row = row_after(command)
    assert row[column] == pytest.approx(value)
    assert row[columns.FEED + 3] == (100.0 if "E100" in command else USUAL.max_feed[3])


def test_klipper_corner_velocity_becomes_a_deviation():
    """v² = a·d·s/(1 - s) at a right angle gives d = v²(√2 - 1)/a back."""
    row = row_after("SET_VELOCITY_LIMIT ACCEL=3000 SQUARE_CORNER_VELOCITY=5")
    half = math.sqrt(0.5)
    assert math.sqrt(3000 * row[columns.DEVIATION] * half / (1 - half)) == pytest.approx(5.0)


def test_settings_cap_what_commands_ask_for():
    """PrusaSlicer's own estimate holds M204 below the profile's largest acceleration."""
    said = stated_limits(SETTINGS)
    row = row_after("M204 S5000", USUAL.under(said), stated=said)
    assert (row[columns.PRINTING], row[columns.TRAVELLING]) == (1500.0, 1700.0)


def test_the_machines_limits_can_be_preferred():
    """With the machine's own limits, M201 is left out, M204 is not: it belongs to the print."""
    row = row_after("M201 X100\nM204 P800", own=False)
    assert row[columns.ACCELERATION] == USUAL.max_acceleration[0]
    assert row[columns.PRINTING] == 800.0


def test_senseless_values_change_nothing():
    """An acceleration of 0 would never arrive."""
    assert row_after("M204 P0")[columns.PRINTING] == USUAL.acceleration
    assert parameters("M204") == {}


def test_settings_reach_the_job_where_no_command_speaks(read):
    """A file with settings only is planned with their accelerations, not the machine's."""
    text = "G1 X0 Y0 F6000\nG1 X9 E1 F1200\nM107\n" + SETTINGS.decode()
    job, _ = read(text, start="G28\nG90\nM83\n;LAYER_CHANGE\n;Z:0.2\n")
    assert job.limits.acceleration == 1500.0
    assert job.limits.travel_acceleration == 1700.0
    assert job.acceleration is None
    job, _ = read("M204 P5000\n" + text, start="G28\nG90\nM83\n;LAYER_CHANGE\n;Z:0.2\n")
    assert job.acceleration is not None and np.nanmax(job.acceleration) == 1500.0


def test_a_job_carries_the_limits_and_each_segments_acceleration(read):
    """What the planner needs of all this: limits of the machine, M204 by segment."""
    text = "M204 P800 T2000\nG1 X0 Y0 F6000\nG1 X9 E1 F1200\nM204 P500\nG1 X20 F6000\nG1 X29 E1\n"
    text = "M201 X900\n" + text
    job, _ = read(text + "M107\n", start="G28\nG90\nM83\n;LAYER_CHANGE\n;Z:0.2\n")
    assert job.limits.max_acceleration[0] == 900.0
    assert job.settings.travel_acceleration == 2000.0
    ends = job.contours.offsets[1:] - 1
    assert job.acceleration is not None
    assert job.acceleration[ends].tolist() == [800.0, 500.0]
