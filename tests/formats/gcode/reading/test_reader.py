"""Contours, epochs, settings and refusals of the reader."""

from __future__ import annotations

import gzip

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.formats.gcode import read_gcode, read_motions
from decmcts.formats.gcode.reading.habits import filament_diameter
from decmcts.print.contours import Role

SQUARE = (
    "G1 X0 Y0 Z0.2 F6000\nG1 F1200\nG1 X10 Y0 E1\nG1 X10 Y10 E2\nG1 X0 Y10 E3\nG1 X0 Y0.1 E3.99\n"
)
LINE = "G1 X20 Y0 F6000\nG1 X30 Y0 E4.99 F1500\n"


def test_square_and_line(read):
    """The plainest print: one closed, one open contour, with feeds, filament and line numbers."""
    job, _ = read(SQUARE + LINE)
    c = job.contours
    assert c.offsets.tolist() == [0, 5, 7]
    assert c.closed.tolist() == [True, False]
    assert c.line.tolist() == [10, 15]
    assert c.extrusion.tolist() == pytest.approx([0, 1, 1, 1, 0.99, 0, 1])
    assert c.feed.tolist() == [0, 20, 20, 20, 20, 0, 25]
    assert c.reversible.all() and (c.epoch == 0).all()


def test_a_pause_or_comment_does_not_split(read):
    """Slicers set the feed between two segments of one bead."""
    job, _ = read("G1 X0 Y0\nG1 X5 E1\nG1 F900\n;WIDTH:0.5\nM204 P500\nG1 X9 E2\n")
    assert len(job.contours) == 1


def test_role_is_the_longest_and_width_the_widest(read):
    """A bead that turns into an overhang half way is still one contour."""
    first = ";TYPE:Perimeter\n;WIDTH:0.4\nG1 X0 Y0\nG1 X5 E1\n"
    text = first + ";TYPE:Overhang perimeter\n;WIDTH:0.6\nG1 X7 E2\n"
    job, _ = read(text)
    assert job.contours.role.tolist() == [Role.PERIMETER]
    assert job.contours.width.tolist() == [0.6]


def test_sizes_without_comments(read):
    """Without comments height is the step in z and width follows from the filament."""
    area = np.pi * 1.75**2 / 4
    e = [0.45 * 0.3 * 10 / area, 0.45 * 0.2 * 10 / area]
    text = f"G1 X0 Y0 Z0.3\nG1 X10 E{e[0]:.5f}\nG1 Z0.5\nG1 X0 E{sum(e):.5f}\n"
    job, _ = read(text)
    assert job.contours.height.tolist() == pytest.approx([0.3, 0.2])
    assert job.contours.width.tolist() == pytest.approx([0.45, 0.45], abs=1e-3)


def test_purge_lines_stay_in_the_preamble(tmp_path):
    """A purge line moved into the print would be printed across it."""
    path = tmp_path / "a.gcode"
    for mark in ("", ";LAYER_CHANGE\n"):
        path.write_text(f"G28\nG1 X0 Y0\nG1 X60 E9\nM109 S200\nG92 E0\nG21\n{mark}{SQUARE}")
        job, document = read_gcode(path)
        assert len(job.contours) == 1
        assert b"G1 X60 E9\n" in document.preamble


@pytest.mark.parametrize(
    "line",
    ["M104 S210", "M109 S210", "T1", "M600", "M25", "G4 P100", "FOO BAR=1", "M1234 S1", "G28 X"],
)
def test_barrier_begins_an_epoch_and_is_named(read, line):
    """Nothing may be moved across it, and the user is told."""
    job, document = read(SQUARE + line + "\n" + LINE)
    assert job.contours.epoch.tolist() == [0, 1]
    assert [b.text for b in job.barriers] == [line]
    assert job.barriers[0].line == 14
    assert document.blocks[0].text == line.encode() + b"\n"


def test_barrier_inside_a_bead_splits_it(read):
    """A temperature set within a line belongs between its halves."""
    job, _ = read("G1 X0 Y0\nG1 X5 E1\nM104 S210\nG1 X9 E2\n")
    assert job.contours.epoch.tolist() == [0, 1]


def test_first_layer_is_an_epoch_when_cooling_changes(read):
    """Upper layers printed under first-layer cooling, or the reverse, spoil the print."""
    second = ";LAYER_CHANGE\n{}G1 Z0.4\nG1 X20 Y20\nG1 X30 E5.99\n"
    job, _ = read("M107\n" + SQUARE + LINE + second.format("M106 S255\n"))
    assert job.contours.epoch.tolist() == [0, 0, 1]
    job, _ = read("M107\n" + SQUARE + LINE + second.format(""))
    assert job.contours.epoch.tolist() == [0, 0, 0]


@pytest.mark.parametrize(("low", "epochs"), [(0.2, [0, 1]), (0.3, [0, 1]), (0.4, [0, 0])])
def test_only_what_lies_on_the_bed_is_a_first_layer(read, low, epochs):
    """What is left of a print begins above what is printed; a bed may be said to lie lower."""
    text = "M107\n"
    for k, fan in enumerate(("M106 S85\n", "M106 S255\n")):
        text += (
            f";LAYER_CHANGE\n;HEIGHT:0.2\n{fan}G1 X0 Y0 Z{low + 0.2 * k:.1f}\nG1 X10 E{k + 0.5}\n"
        )
    job, _ = read(text)
    assert job.contours.epoch.tolist() == epochs


def test_state_first_set_in_the_print_ends_an_epoch(read):
    """What held before the first M204 cannot be set again, so nothing moves across it."""
    job, _ = read(SQUARE + "M204 P500\n" + LINE)
    assert job.contours.epoch.tolist() == [0, 1]


@pytest.mark.parametrize(
    ("text", "reversible"),
    [
        (";TYPE:Ironing\nG1 X0 Y0\nG1 X5 E1\n", False),
        ("G1 X0 Y0 Z.2\nG1 X5 Z.3 E1\n", False),
        ("G1 X0 Y0\nG1 X5 E1\n", True),
        ("G1 X0 Y0\nG1 X5 E1\nG1 X4 E0.5\n", True),
        ("G1 X0 Y0\nG1 X5 E1\nG1 X5 Y0 E1.01\n", False),
        ("G1 X0 Y0\nG1 X2 E.05\nG1 X9 E1\nG1 Y9 E2\nG1 X0 E3\nG1 Y0 E3.1\n", False),
    ],
)
def test_what_may_be_reversed(read, text, reversible):
    """Ironing, slopes, flow ramps and blobs change when reversed; plain beads and wipes do not."""
    assert read(text)[0].contours.reversible.tolist() == [reversible]


def test_vase_is_one_contour(read):
    """Continuous Z cannot be cut."""
    reversible = "".join(
        f"G1 X{10 * np.cos(t):.3f} Y{10 * np.sin(t):.3f} Z{t / 30:.4f} E{t:.4f}\n"
        for t in np.arange(1, 60, 0.3)
    )
    job, _ = read("G1 X10 Y0 Z0\n" + reversible)
    assert len(job.contours) == 1 and not job.contours.reversible[0]


def test_retraction_habits(read):
    """Travels are made anew with the source's own retraction."""
    gap = "G1 E{:.5f} F2400\nG1 Z.6\nG1 X{} Y0 F9000\nG1 Z.2\n"
    gap += "G1 E{:.5f} F1800\nG1 X{} E{:.5f} F1200\n"
    text = "G1 X0 Y0 Z.2\nG1 X5 E1 F1200\n" + "".join(
        gap.format(k - 0.8, 20 * k, k, 20 * k + 5, k + 1) for k in range(1, 6)
    )
    settings = read(text)[0].settings
    assert settings.retract_mm == pytest.approx(0.8)
    assert (settings.retract_feed, settings.unretract_feed, settings.travel_feed) == (40, 30, 150)
    assert settings.hop_mm == pytest.approx(0.4)


def test_motions_cover_the_whole_file(tmp_path):
    """The judge needs every move, the start and the end included."""
    path = tmp_path / "a.gcode"
    path.write_text("G28\nM83\nG1 X5 E1 F600\n;LAYER:0\nG1 X9 Z.2\nG1 X20 E1\nG1 X0\n")
    motions = read_motions(path)
    assert motions.contour.tolist() == [-1, -1, -1, 0, -1]
    assert motions.line.tolist() == [1, 3, 5, 6, 7]
    assert (motions.width > 0).tolist() == [False, False, False, True, False]


def test_gzip_reads_as_plain(tmp_path):
    """Half of all files arrive packed."""
    path = tmp_path / "a.gcode.gz"
    path.write_bytes(gzip.compress((";LAYER:0\n" + SQUARE).encode()))
    assert len(read_gcode(path)[0].contours) == 1


@pytest.mark.parametrize(
    ("raw", "what"),
    [
        (b"", "empty"),
        (b" \n\n", "empty"),
        (b"GCDE\1\0\0\0", "damaged binary G-code"),
        (b"\x89PNG\0\0", "binary"),
        (b"\x1f\x8b\x08broken", "gzip"),
        (b"G28\nG1 X1 Y1\n", "nothing is extruded"),
        (b";LAYER:0\nG91\nG1 X1 E1\n", "relative"),
        (b";LAYER:0\nG1 X1 E1\nG92 X0\nG1 X5 E2\n", "origin"),
        (b";LAYER:0\nG1 X1 E1\nG55\nG1 X5 E2\n", "work coordinate"),
        (b";LAYER:0\nG20\nG1 X1 E1\n", "inches"),
        (b";LAYER:0\nG1 X1 E1\nM200 D2\nG1 X5 E2\n", "M200"),
    ],
)
def test_unusable_files_are_refused_by_name(read, raw, what):
    """Each refusal names the construct; none is a silent re-interpretation."""
    with pytest.raises(InputError, match=what):
        read(raw)


def test_missing_file_is_refused(tmp_path):
    """A wrong path is one clear line."""
    with pytest.raises(InputError, match="cannot be read"):
        read_gcode(tmp_path / "absent.gcode")


def test_fan_on_and_off_is_no_epoch(read):
    """Bridges switch the fan all the time; that state can be put back anywhere."""
    more = "".join(
        f"M106 S255\nG1 X{k} Y9\nG1 X{k + 5} E{k}\nM107\nG1 Y11\nG1 X0 E{k + 4}\n" for k in (9, 19)
    )
    job, _ = read(
        "M107\n" + SQUARE + more + ";LAYER_CHANGE\nG1 Z.4\nG1 X5 Y0 E30\nM106 S255\nG1 X9 E31\n"
    )
    assert (job.contours.epoch == 0).all()


def test_parameter_first_set_in_the_print_ends_an_epoch(read):
    """M205 Y after M205 X adds to it; before it, Y was the firmware's own, which nobody knows."""
    job, _ = read("M205 X8\n" + SQUARE + "M205 Y5\n" + LINE)
    assert job.contours.epoch.tolist() == [0, 1]


@pytest.mark.parametrize(
    ("label", "end", "epoch"),
    [("M486 S0", "", [0, 1, 2]), ("M486 S0", "M486 S-1", [0, 0, 0]), (";MESH:a", "", [0, 0, 0])],
)
def test_a_label_that_nothing_ends_is_not_gone_back_behind(read, label, end, epoch):
    """Set within a contour: what lies before it cannot be printed later without the label."""
    lines = [f"G1 X{x} Y0 F6000\nG1 X{x + 5} E.5 F900\n@G1 X{x + 9} E.4\n" for x in (0, 20, 40)]
    text = "".join(lines).split("@")
    text.insert(2, f"{label}\n")
    job, _ = read("M83\n" + "".join(text) + (f"{end}\n" if end else "") + "M84\n")
    assert job.contours.epoch.tolist() == epoch


@pytest.mark.parametrize(
    ("said", "mm"),
    [("0.5.75", 1.75), ("2.85.1", 2.85), (".", 1.75), ("3", 3.0), ("1.75,1.75", 1.75)],
)
def test_a_filament_diameter_that_is_no_number_ends_nothing(said, mm):
    """Two dots in it were an internal error."""
    assert filament_diameter(f"; filament_diameter = {said}".encode()) == mm
