"""The modal interpreter: what the controller would do."""

from __future__ import annotations

import math

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.formats.gcode.controller.motion import CHORD_ERROR_MM, interpret
from decmcts.formats.gcode.text.lines import split_lines


def run(text: str):
    return interpret(split_lines(text.encode(), "t"))


def test_feed_is_modal_and_in_mm_per_second():
    """F holds until it changes, alone on a line or not."""
    assert run("G1 F1200\nG1 X1\nG1 X2 F600\nG1 X3\n").feed.tolist() == [20, 20, 10, 10]


def test_absolute_and_relative_e_give_the_same_filament():
    """E mode is spelling: the filament pushed is what counts."""
    absolute = run("M82\nG1 X1 E1\nG92 E0\nG1 X2 E.5\n").extrusion
    relative = run("M83\nG1 X1 E1\nG1 X2 E.5\n").extrusion
    assert absolute.tolist() == pytest.approx(relative.tolist())


def test_g90_does_not_undo_m83():
    """PrusaSlicer ends relative blocks with G90 and goes on with relative E."""
    assert run("M83\nG91\nG1 Z1\nG90\nG1 X1 E.5\nG1 X2 E.5\n").extrusion.tolist() == [0, 0.5, 0.5]


def test_volumetric_e_becomes_filament():
    """M200 D counts mm³; contours hold mm of filament."""
    assert run("M83\nM200 D2\nG1 X1 E3.14159265\n").extrusion[0] == pytest.approx(1.0, abs=1e-6)


def test_g10_with_parameters_is_a_temperature():
    """On RepRapFirmware G10 S200 P0 heats a tool; taken for a retraction it would starve it."""
    assert run("G10\n").modes[0, 3] == 1
    assert run("G10 P0 S200\n").modes[0, 3] == 0


@pytest.mark.parametrize("words", ["P1 X0 Y2 Z-.1", "L1 P1 Z0", "L2 P1 X5", "P1", "X5", "P0 U0"])
def test_an_offset_of_a_tool_is_no_retraction(words):
    """G10 sets offsets too: taken for a retraction, all travels were written with G10 and G11."""
    assert run(f"G10 {words}\n").modes[0, 3] == 0
    assert run(f"G10\nG11 {words}\n").modes[1, 3] == 1


@pytest.mark.parametrize(
    "arc", ["G2 X10 Y0 I5 J0 E2", "G2 X10 Y0 R5 E2", "G3 X10 Y0 I5 E2", "G3 X10 R-5 E2"]
)
def test_arc_keeps_length_filament_and_tolerance(arc):
    """A linearised arc must be the same bead: chords on the circle, E shared by length."""
    motion = run(f"M83\nG1 X0 Y0 F600\n{arc}\n")
    points = motion.points[1:]
    radius = np.hypot(points[:, 0] - 5, points[:, 1])
    middle = (points[1:] + points[:-1]) / 2
    assert np.abs(radius - 5).max() < 1e-3
    assert 5 - np.hypot(middle[:, 0] - 5, middle[:, 1]).min() < CHORD_ERROR_MM + 1e-3
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(
        5 * math.pi, rel=1e-3
    )
    assert motion.extrusion.sum() == pytest.approx(2.0, abs=1e-6)
    assert (points[1:-1, 1] > 0).all() == arc.startswith("G2")


def test_full_circle():
    """Equal ends with I and J are a whole turn, not nothing."""
    motion = run("M83\nG1 X10 Y5\nG2 X10 Y5 I-5 J0 E1\n")
    assert np.linalg.norm(np.diff(motion.points[1:], axis=0), axis=1).sum() == pytest.approx(
        10 * math.pi, rel=1e-3
    )


@pytest.mark.parametrize(
    "line", ["G20", "G68 X1 Y1 R9", "G16", "G2 X5 Y5 R1", "G18", "G5 I1 J1 X2"]
)
def test_frames_nobody_can_plan_are_refused(line):
    """Inches, rotations, polar moves and impossible arcs would put beads elsewhere."""
    with pytest.raises(InputError) as error:
        run(f"G28\nG1 X1\n{line}\nG1 X2\nG2 X3 I1\n")
    assert error.value.line == 3


def test_homing_and_g92_are_moves_without_feed():
    """Positions stay continuous, so nobody sees a bead across the bed after homing."""
    motion = run("G1 X5 Y6 Z7 F60\nG28 X\nG92 Z1\nG1 Y1\n")
    assert motion.points.tolist() == [[0, 0, 0], [5, 6, 7], [0, 6, 7], [0, 6, 1], [0, 1, 1]]
    assert motion.feed.tolist() == [1, 0, 0, 1]
