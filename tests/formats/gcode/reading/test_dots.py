"""Vertical beads and dots: filament that is laid down without a way across the bed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decmcts.formats.gcode import read_gcode

START = "M104 S210\nG28\nG90\nM83\n"
BEAD = "G0 X0 Y0 Z0.3 F8000\nG1 X15 E0.6 F1200\n"
NEXT = "G0 X0 Y50 Z0.3 F8000\nG1 X15 E0.6 F1200\n"
DOT = "G0 Z1\nG0 X7 Y20 F8000\nG0 Z0.6 F600\nG1 E1.5 F100\nG0 Z1\n"
AREA = np.pi * 1.75**2 / 4.0


@pytest.fixture
def contours(tmp_path):
    """Read lines below a start code in relative E, or others."""

    def read(text, start=START, end="M104 S0\nM84\n"):
        path = tmp_path / "a.gcode"
        path.write_text(start + text + end)
        job, document = read_gcode(path)
        return job.contours, document

    return read


def ways(c):
    return [c.polyline(k).tolist() for k in range(len(c))]


def filament(c):
    return [c.extrusion[a:b].tolist() for a, b in zip(c.offsets[:-1], c.offsets[1:], strict=True)]


def test_a_dot_is_a_contour_at_a_point(contours):
    """Braille, spot welds: five of six dots were lost, and the file was called verified."""
    c, document = contours(BEAD + DOT + NEXT)
    assert ways(c)[1] == [[7.0, 20.0, 0.6], [7.0, 20.0, 0.6]]
    assert filament(c)[1] == [0.0, 1.5]
    assert c.feed[c.offsets[1] + 1] == pytest.approx(100 / 60)
    assert not c.closed[1] and not c.reversible[1]
    assert c.height[1] == pytest.approx(0.3)  # above the beads' level
    assert c.width[1] == pytest.approx(np.sqrt(4 * 1.5 * AREA / (np.pi * 0.3)))
    assert document.blocks == ()


def test_the_last_dot_is_none_of_the_end_code(contours):
    """What stands behind the last bead and before the first command of the end is the print's."""
    c, document = contours(BEAD + NEXT + DOT)
    assert len(c) == 3
    assert document.postamble == b"G0 Z1\nM104 S0\nM84\n"


@pytest.mark.parametrize("end", ["M104 S0\nG1 E5\nM84\n", "G91\nG1 E5\n", ";TYPE:Custom\nG1 E5\n"])
def test_what_the_end_code_pushes_is_no_dot(contours, end):
    """A nozzle is rammed or emptied there, behind a command or in relative positions."""
    c, document = contours(BEAD + NEXT + "G0 X0 Y100\n", end=end)
    assert len(c) == 2 and b"G1 E5\n" in document.postamble


def test_a_pillar_is_a_contour(contours):
    """`G1 Z6 E1.2`: eight of nine pillars were lost."""
    pillar = "G0 X5 Y20 Z0.3\nG1 Z3 E0.6 F200\nG1 Z6 E0.6\nG0 Z8\n"
    c, _ = contours(BEAD + pillar + NEXT)
    assert ways(c)[1] == [[5.0, 20.0, 0.3], [5.0, 20.0, 3.0], [5.0, 20.0, 6.0]]
    assert filament(c)[1] == [0.0, 0.6, 0.6]
    assert not c.closed[1] and not c.reversible[1]
    assert c.layer[1] == c.layer[0]  # where it begins
    assert c.height[1] == pytest.approx(0.3)
    assert c.width[1] == pytest.approx(np.sqrt(4 * 1.2 * AREA / (np.pi * 5.7)))


def test_a_pillar_may_begin_with_a_bead(contours):
    """The foot of a pillar is one contour with it; its width is its bead's."""
    c, _ = contours("G0 X0 Y0 Z0.5 F8000\nG1 X3 E0.5 F1000\nG1 Z6 E1.2 F200\nG0 Z8\n" + NEXT)
    assert len(c) == 2
    assert ways(c)[0] == [[0, 0, 0.5], [3, 0, 0.5], [3, 0, 6]]
    assert c.width[0] == pytest.approx(0.5 * AREA / (3 * c.height[0]))


def test_a_blob_at_the_end_of_a_bead_belongs_to_it(contours):
    """Without a travel in between nothing may come between the two."""
    c, _ = contours(BEAD + "G1 E0.8 F100\n" + NEXT)
    assert ways(c)[0] == [[0, 0, 0.3], [15, 0, 0.3], [15, 0, 0.3]]
    assert filament(c)[0] == [0.0, 0.6, 0.8]
    assert not c.reversible[0]


def test_a_blob_between_two_beads_keeps_them_together(contours):
    c, document = contours(BEAD + "G1 E0.8 F100\nG1 Y20 E0.7 F1200\n" + NEXT)
    assert filament(c)[0] == [0.0, 0.6, 0.8, 0.7]
    assert document.blocks == ()


def test_several_pushes_at_one_place_are_one_dot(contours):
    c, _ = contours(BEAD + DOT.replace("G1 E1.5 F100", "G1 E1 F100\nG1 E.5 F60") + NEXT)
    assert filament(c)[1] == [0.0, 1.0, 0.5]
    assert c.width[1] == pytest.approx(np.sqrt(4 * 1.5 * AREA / (np.pi * 0.3)))


def test_a_dot_counts_beyond_what_was_retracted(contours):
    """Its line pays back the retraction too: that is no part of the dot."""
    text = BEAD + "G1 E-0.8 F2100\n" + DOT.replace("E1.5", "E2.3") + NEXT
    c, document = contours(text)
    assert filament(c)[1] == pytest.approx([0.0, 1.5])
    assert not document.owed.any() and document.blocks == ()
    assert c.width[1] == pytest.approx(np.sqrt(4 * 1.5 * AREA / (np.pi * 0.3)))


@pytest.mark.parametrize(
    "between",
    [
        "G1 E-0.8\nG0 X7 Y20\nG1 E0.8\n",  # paid back before another travel
        "G1 E-0.8\nG0 Z1\nG0 X0 Y50\nG1 Z0.3 E0.8\n",  # on the way down
        "G1 E-0.8\nG0 Z1\nG0 X0 Y50\nG1 E0.9\nG0 Z0.3\n",  # with a restart distance, then down
        "G1 E-0.8\nG0 X0 Y50 Z0.3\nG1 E1.6\n",  # with a large one: it belongs to the bead
        "G1 E-0.8\nG0 X0 Y50 Z0.3\nG1 E0.4\nG1 E0.4\n",
        "G10\nG0 X7 Y20\nG11\n",
    ],
)
def test_a_retraction_paid_back_is_no_dot(contours, between):
    """Push-backs are remade from habits; as dots they would be pushed twice."""
    c, _ = contours(BEAD + between + NEXT)
    assert len(c) == 2 and (np.diff(c.points, axis=0) != 0).any(axis=1).all()


def test_what_follows_a_firmware_retraction_may_be_a_dot(contours):
    """`G11` pays back what `G10` has retracted: the push behind it lies there."""
    dot = DOT.replace("G1 E1.5 F100", "G11\nG1 E1.5 F100\nG10")
    c, _ = contours(BEAD + "G10\n" + dot + "G11\n" + NEXT)
    assert filament(c)[1] == [0.0, 1.5]


def test_tool_changes_and_what_lies_between_barriers_stay_as_they_are(contours):
    """A nozzle is loaded and purged there: as dots that would be printed anywhere."""
    load = "G1 E-2\nT1\nG0 X200 Y0\nG1 E30 F100\nG1 E5\nM104 S220\n"
    c, document = contours(BEAD + load + NEXT)
    assert len(c) == 2
    assert b"G1 E30 F100\nG1 E5\n" in document.blocks[0].text
    tower = "; CP TOOLCHANGE START\nG0 X200 Y0\nG1 E10\nG0 X210\n; CP TOOLCHANGE END\n"
    assert len(contours(BEAD + tower + NEXT)[0]) == 2


def test_a_dwell_behind_a_dot_leaves_it_a_dot(contours):
    """Welds are given time; a dwell is a barrier, which the dot stays before."""
    c, _ = contours(BEAD + DOT.replace("G1 E1.5 F100\n", "G1 E1.5 F100\nG4 P500\n") + NEXT)
    assert filament(c)[1] == [0.0, 1.5]
    assert c.epoch.tolist() == [0, 0, 1]


def test_what_primes_the_nozzle_before_the_first_bead_is_start_code(contours):
    """A blob beside the print; where several places have one they are the print's."""
    c, document = contours(DOT + BEAD + NEXT)
    assert len(c) == 2 and b"G1 E1.5 F100\n" in document.preamble
    c, _ = contours(DOT + DOT.replace("X7", "X30") + BEAD + NEXT)
    assert len(c) == 4
    c, _ = contours(";LAYER:0\n" + DOT + BEAD + NEXT)
    assert len(c) == 3


@pytest.mark.parametrize(("pulled", "tied"), [("", True), ("G1 E-0.8 F2400\n", False)])
def test_a_bead_that_is_primed_where_it_begins_stays_as_sliced(contours, pulled, tied):
    """The start code primes there; entered elsewhere the push was read as a dot, and refused."""
    bead = "G0 X0 Y0 Z0.3 F8000\nG1 E0.8 F2400\nG1 X15 E0.6 F1200\n"
    c, _ = contours(";LAYER_CHANGE\n" + bead + NEXT, start=START + pulled)
    assert c.reversible.tolist() == [not tied, True]


def test_a_print_of_dots_alone(contours):
    """Nothing of it goes across the bed."""
    text = "".join(DOT.replace("X7", f"X{x}") for x in range(10, 60, 10))
    c, _ = contours(text)
    assert len(c) == 5 and c.extrusion.sum() == pytest.approx(7.5)
    assert c.height == pytest.approx(0.6)


dot_sizes = st.lists(st.integers(5, 300), min_size=1, max_size=6)


@settings(deadline=None, max_examples=40)
@given(sizes=dot_sizes, absolute=st.booleans(), pulled=st.integers(0, 120))
def test_every_dot_is_kept_whatever_its_size(tmp_path_factory, sizes, absolute, pulled):
    """In M82 and M83, retracted before or not: as many dots, with as much filament."""
    lines, e = [], 0.0

    def push(amount):
        nonlocal e
        e += amount
        return f"E{e:.5f}" if absolute else f"E{amount:.5f}"

    lines += ["M82" if absolute else "M83", "G1 X0 Y0 Z.3 F6000", f"G1 X10 {push(0.5)} F900"]
    for k, size in enumerate(sizes):
        dot = 0.01 * size
        if pulled:
            lines.append(f"G1 {push(-0.01 * pulled)} F2000")
        lines += ["G1 Z2", f"G1 X{20 * k} Y30 F6000", "G1 Z.6"]
        lines += [f"G1 {push(0.01 * pulled)} F2000"] if pulled else []
        lines += [f"G1 {push(dot)} F60", "G1 Z2"]
    lines += ["G1 X0 Y60", "G1 Z.3", f"G1 X10 {push(0.5)} F900", "M84"]
    path = tmp_path_factory.mktemp("dots") / "a.gcode"
    path.write_text("\n".join(lines) + "\n")
    c = read_gcode(path)[0].contours
    assert [x for each in filament(c)[1:-1] for x in each[1:]] == pytest.approx(
        [0.01 * size for size in sizes], abs=2e-5
    )
