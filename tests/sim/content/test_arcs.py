"""Arcs compared as arcs: by their ends, their centres, their filament and their feed."""

from __future__ import annotations

import pytest

from decmcts.formats.gcode import read_gcode, read_motions
from sim.content.arcs import check_arcs, turns_of, turns_of_print
from sim.faults import FaultKind

START = "G28\nM83\n;LAYER_CHANGE\n;Z:0.2\n"
LOOP = "G1 X20 Y10 Z.2 F6000\nG3 X0 Y10 I-10 J0 E1.05 F1200\nG3 X20 Y10 I10 J0 E1.05\n"
SHORT = "G1 X50 Y10 F6000\nG2 X50.3 Y10.1 I5 J-20 E.02 F1200\n"  # 0.3 µm from its chord
TEXT = START + LOOP + SHORT


@pytest.fixture
def faults(tmp_path):
    """Return the faults of a text held against `TEXT`."""

    def judge(text: str, moved=(), source: str = TEXT):
        (tmp_path / "in.gcode").write_text(source)
        (tmp_path / "out.gcode").write_text(text)
        theirs = turns_of_print(*read_gcode(tmp_path / "in.gcode"))
        assert (
            theirs.contour.tolist()
            == turns_of(read_motions(tmp_path / "in.gcode")).contour.tolist()
        )
        return check_arcs(turns_of(read_motions(tmp_path / "out.gcode")), theirs, set(moved))

    return judge


def test_an_arc_run_the_other_way_is_the_same_arc(faults):
    """Reversed contours are what a better order is made of."""
    back = "G1 X50.3 Y10.1 F6000\nG3 X50 Y10 I4.7 J-20.1 E.02 F1200\n"
    assert faults(TEXT) == []
    assert faults(START + LOOP + back) == []


@pytest.mark.parametrize(
    ("was", "new"),
    [
        ("G2 X50.3 Y10.1 I5 J-20", "G1 X50.3 Y10.1"),
        ("G2 X50.3", "G3 X50.3"),
        ("I5 J-20", "I5.01 J-20.2"),
        ("G2 X50.3 Y10.1", "G2 X50.4 Y10.1"),
        ("G3 X20 Y10 I10 J0 E1.05\n", ""),
    ],
)
def test_no_arc_may_become_another(faults, was, new):
    """A line so near to an arc has chords like it; only the arc's own words tell them apart."""
    assert was in TEXT
    assert {fault.kind for fault in faults(TEXT.replace(was, new))} == {FaultKind.ARC}


def test_filament_and_feed_are_the_arc_s(faults):
    """A sum of rounded shares could be right chord by chord and wrong altogether."""
    assert [f.kind for f in faults(TEXT.replace("E.02", "E.0202"))] == [FaultKind.EXTRUSION]
    assert [f.kind for f in faults(TEXT.replace("E.02 F1200", "E.02 F1210"))] == [FaultKind.FEED]


PARTED = (
    "G1 X10 Y20 Z.2 F6000\nG3 X0 Y10 J-10 E.525 F1200\nG3 X20 Y10 I10 J0 E1.05\n"
    "G3 X10 Y20 I-10 E.525\n"
)


def test_a_loop_that_is_entered_elsewhere_may_have_its_arcs_in_parts(faults):
    """Its seam lies within an arc then; other loops have none of that."""
    assert faults(START + PARTED + SHORT, moved={0}) == []
    assert {f.kind for f in faults(START + PARTED + SHORT)} == {FaultKind.ARC}


@pytest.mark.parametrize(
    ("was", "new"),
    [
        ("X0 Y10 J-10", "X10 Y0 J-10"),  # beyond the end of the arc it is part of
        ("G3 X0 Y10 J-10", "G2 X0 Y10 J-10"),
        ("J-10", "I.1 J-10.1"),
    ],
)
def test_a_part_lies_on_its_arc(faults, was, new):
    """A part by name alone would let any arc pass in a loop that is entered elsewhere."""
    text = START + PARTED.replace(was, new, 1) + SHORT
    assert FaultKind.ARC in {f.kind for f in faults(text, moved={0})}


def test_arcs_by_radius_have_a_centre_of_the_judge_s_own(faults):
    """R says which of two centres by its sign; the result has I and J."""
    source = (
        START + "G1 X0 Y0 Z.2 F6000\nG3 X8 Y0 R-5 E1 F1200\nG1 X50 F6000\nG2 X58 Y0 R5 E1 F1200\n"
    )
    due = (
        START
        + "G1 X0 Y0 Z.2 F6000\nG3 X8 Y0 I4 J-3 E1 F1200\nG1 X50 F6000\nG2 X58 Y0 I4 J-3 E1 F1200\n"
    )
    assert faults(due, source=source) == []
    other = due.replace("G3 X8 Y0 I4 J-3", "G3 X8 Y0 I4 J3")
    assert {f.kind for f in faults(other, source=source)} == {FaultKind.ARC}


def test_a_print_without_arcs_has_none(faults):
    """Most files: nothing to compare, and an arc in the result is one too many."""
    lines = START + "G1 X20 Y10 Z.2 F6000\nG1 X0 Y10 E1 F1200\n"
    assert faults(lines, source=lines) == []
    assert [f.kind for f in faults(lines + SHORT, source=lines)] == [FaultKind.ARC]
