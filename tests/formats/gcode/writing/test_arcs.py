"""Arcs of a source are arcs of the result, whichever way they run and wherever they begin."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decmcts.errors import InputError
from decmcts.formats.gcode import read_gcode, read_motions, write_gcode
from decmcts.formats.gcode.document import NO_ARC
from decmcts.formats.gcode.writing.beads import BeadRows
from decmcts.formats.gcode.writing.emitter import Emitter
from decmcts.formats.gcode.writing.writer import print_contour
from decmcts.print.loops import allowed_entries
from decmcts.print.toolpath import Toolpath
from sim.content.arcs import check_arcs, turns_of, turns_of_print
from sim.content.seams import seams_of_plan
from tests.direct_actions import direct_actions
from tests.makers.same_extrusions import same_extrusions, source_with

START = "G28\nM83\n;LAYER_CHANGE\n;Z:0.2\n"
CIRCLE = "G1 X20 Y10 Z.2 F6000\nG3 X20 Y10 I-10 J0 E2.1 F1200\n"
CLIPPED = (
    ";TYPE:External perimeter\nG1 X20 Y10 Z.2 F6000\nG3 X0 Y10 I-10 J0 E1.05 F1200\n"
    "G3 X10 Y0 I10 E.525\n"
    "G3 X20 Y9.9 J10 E.52166\n"
)


def arc_lines(text: bytes) -> list[bytes]:
    return [line for line in text.split(b"\n") if re.match(rb"G[23] ", line)]


def written(tmp_path, source, *, is_reversed=False, entry=0):
    """Write a source with every contour reversed, or entered elsewhere, as far as it may be."""
    job, document = read_gcode(source)
    n = len(job.contours)
    path = Toolpath.of(np.arange(n, dtype=np.int32), job.contours.reversible & is_reversed)
    path = replace(path, entry=np.full(n, entry, np.int32))
    actions = direct_actions(job, path)
    out = tmp_path / "out.gcode"
    write_gcode(document, job, actions, out)
    return job, document, actions, out


@pytest.mark.parametrize(
    ("arc", "forward", "back"),
    [
        ("G2 X9 Y0 I4.5 J0 E.7", "G2 X9.000 Y0.000 I4.500 J0.000", "G3 X0.000 Y0.000 I-4.500"),
        ("G3 X9 Y0 I4.5 E.7", "G3 X9.000 Y0.000 I4.500 J0.000", "G2 X0.000 Y0.000 I-4.500"),
        ("G3 X8 Y0 R-5 E1.1", "G3 X8.000 Y0.000 I4.000000 J-3", "G2 X0.000 Y0.000 I-4.000000 J-3"),
        ("G2 X8 Y0 R5 E1.1", "G2 X8.000 Y0.000 I4.000000 J-3", "G3 X0.000 Y0.000 I-4.000000 J-3"),
        ("G2 I3 J4 E1.1", "G2 X0.000 Y0.000 I3.000 J4.000", "G3 X0.000 Y0.000 I3.000 J4.000"),
        ("G2 X9 Z1 I4.5 E.7", "G2 X9.000 Y0.000 Z1.000 I4.500 J0.000", None),
    ],
)
def test_an_arc_is_one_arc(tmp_path, arc, forward, back):
    """Reversed it is the opposite command around the same centre; a helix runs one way only."""
    source = tmp_path / "in.gcode"
    source.write_text(START + f"G1 X0 Y0 Z.2 F6000\n{arc} F900\nG1 X50 F6000\nG1 X60 E.3\n")
    for is_reversed, due in ((False, forward), (True, back)):
        if due is None:
            assert not read_gcode(source)[0].contours.reversible[0]
            continue
        *_, out = written(tmp_path, source, is_reversed=is_reversed)
        (line,) = arc_lines(out.read_bytes())
        assert line.decode().startswith(due)
        assert float(re.search(rb"E([\d.]+)", line)[1]) == float(re.search(r"E([\d.]+)", arc)[1])


@st.composite
def arcs(draw):
    """Draw an arc as a slicer writes it: everything to three decimals."""
    radius = draw(st.floats(0.02, 200.0))
    begin = draw(st.floats(0.0, 2 * math.pi))
    near_whole = st.floats(2 * math.pi - 0.05, 2 * math.pi - 1e-3)
    sweep = draw(st.floats(0.001, 6.2) | near_whole | st.just(math.pi) | st.just(2 * math.pi))
    clockwise, length = draw(st.booleans()), radius * sweep
    x0, y0 = (round(100.0 + radius * f(begin), 3) for f in (math.cos, math.sin))
    end = begin + (-sweep if clockwise else sweep)
    x1, y1 = (round(100.0 + radius * f(end), 3) for f in (math.cos, math.sin))
    if (x0, y0) == (x1, y1) and sweep < 6.0:
        x1 = round(x1 + 0.002, 3)
    i, j = round(100.0 - x0, 3), round(100.0 - y0, 3)
    e = max(round(0.03 * length, 5), 1e-4)
    way = f"G1 X{x0:.3f} Y{y0:.3f} F6000\nG1 F900\n"
    return way + f"G{2 if clockwise else 3} X{x1:.3f} Y{y1:.3f} I{i:.3f} J{j:.3f} E{e:.5f}\n"


@settings(max_examples=60, deadline=None)
@given(drawn=st.lists(arcs(), min_size=1, max_size=4), is_reversed=st.booleans())
def test_what_is_written_reads_back_the_same(tmp_path_factory, drawn, is_reversed):
    """Chords, filament and circles to the last bit, so that nothing drifts and all is matched."""
    folder = tmp_path_factory.mktemp("arcs")
    source = folder / "in.gcode"
    apart = "G1 Z5 F600\nG1 X-50 Y-50 F6000\nG1 Z.2 F600\n"
    source.write_text(START + apart + apart.join(drawn) + apart)
    job, document, actions, out = written(folder, source, is_reversed=is_reversed)
    again, their = read_gcode(out)
    assert len(again.contours) == len(job.contours)
    for c in range(len(job.contours)):
        a, b = (slice(*x.contours.offsets[c : c + 2]) for x in (job, again))
        step = -1 if actions.reversed[actions.contour == c][0] else 1
        assert (again.contours.points[b][::step] == job.contours.points[a]).all()
        pushed = again.contours.extrusion[b][1:][::step]
        assert np.abs(pushed - job.contours.extrusion[a][1:]).max() < 1e-12
    assert len(arc_lines(out.read_bytes())) == len(drawn)
    assert len(np.unique(their.point_arc[their.point_arc != NO_ARC])) == len(drawn)
    assert check_arcs(turns_of(read_motions(out)), turns_of_print(job, document), set()) == []


@pytest.mark.parametrize("is_reversed", [False, True])
@pytest.mark.parametrize("loop", [CIRCLE, CLIPPED])
def test_a_loop_is_entered_within_an_arc(tmp_path, loop, is_reversed):
    """The arc is parted there exactly: same circle, same chords, same filament altogether."""
    source = tmp_path / "in.gcode"
    source.write_text(START + loop + "G1 X50 F6000\nG1 X60 E.3\n")
    job, document = read_gcode(source)
    entries = np.flatnonzero(allowed_entries(job.contours)[: job.contours.offsets[1]])
    assert len(entries) > 50
    for entry in entries[1::9].tolist():
        path = Toolpath.of(np.arange(2, dtype=np.int32), np.array([is_reversed, False]))
        actions = direct_actions(job, replace(path, entry=np.array([entry, 0], np.int32)))
        write_gcode(document, job, actions, tmp_path / "out.gcode")
        again, their = read_gcode(tmp_path / "out.gcode")
        entered, its = source_with(job, document, seams_of_plan(actions))
        assert same_extrusions(entered, its, again, their) == []
        due = entered.contours.polyline(0)[:: -1 if is_reversed else 1]
        assert np.abs(again.contours.polyline(0) - due).max() < 1.5e-3
        assert again.contours.extrusion.sum() == pytest.approx(
            job.contours.extrusion.sum(), abs=2e-5
        )
        lines = arc_lines((tmp_path / "out.gcode").read_bytes())
        parts = len(np.unique(document.point_arc[document.point_arc != NO_ARC])) + 1
        assert parts - 1 <= len(lines) <= parts
        ours = turns_of(read_motions(tmp_path / "out.gcode"), all_moves=False)
        assert check_arcs(ours, turns_of_print(job, document), {0}) == []
        text = (tmp_path / "out.gcode").read_text()
        assert text.count("\nG1 X") <= 12  # what a gap leaves of a chord, but no arc in chords


def test_a_part_of_an_arc_that_would_read_back_otherwise_is_written_in_chords(tmp_path):
    """At some radii rounding changes how many chords there are; chords are right as well."""
    source = tmp_path / "in.gcode"
    source.write_text(START + CIRCLE + "G1 X50 F6000\nG1 X60 E.3\n")
    job, document = read_gcode(source)
    table = replace(document.arcs, partible=np.zeros(1, np.bool_))
    document = replace(document, arcs=table)
    path = Toolpath.of(np.arange(2, dtype=np.int32), np.zeros(2, np.bool_))
    actions = direct_actions(job, replace(path, entry=np.array([20, 0], np.int32)))
    write_gcode(document, job, actions, tmp_path / "out.gcode")
    again, _ = read_gcode(tmp_path / "out.gcode")
    assert arc_lines((tmp_path / "out.gcode").read_bytes()) == []
    entered, _ = source_with(job, document, seams_of_plan(actions))
    assert np.abs(again.contours.points - entered.contours.points).max() < 1e-6


def test_filament_is_the_source_s_to_its_decimals(tmp_path):
    """Sums of rounded shares of chords would drift; absolute E shows it."""
    source = tmp_path / "in.gcode"
    text = "G28\nM82\n;LAYER_CHANGE\n;Z:0.2\nG1 Z.2 F600\n"
    for k in range(200):
        text += f"G1 X{20 + k % 9} Y10 F6000\nG92 E0\nG3 X{k % 9} Y10 R10 E1.0{k % 7}133 F900\n"
    source.write_text(text)
    job, _, _, out = written(tmp_path, source, is_reversed=True)
    again, _ = read_gcode(out)
    assert again.contours.extrusion.sum() == pytest.approx(job.contours.extrusion.sum(), abs=1e-6)


@pytest.mark.parametrize("is_reversed", [False, True])
def test_an_arc_is_parted_where_a_head_signals(tmp_path, is_reversed):
    """Its line has no place for a signal, and two at its end would come at once."""
    source = tmp_path / "in.gcode"
    source.write_text(START + CLIPPED)
    job, document = read_gcode(source)
    emitter = Emitter(document, job.settings)
    last = len(job.contours.points) - 1
    passed = {5: "FIVE", 9: "NINE", last: "END"}
    print_contour(
        emitter, BeadRows.of(document, job), 0, [], is_reversed=is_reversed, entry=0, passed=passed
    )
    rows = [line.split()[0] for line in emitter.lines]
    arc = b"G2" if is_reversed else b"G3"
    assert rows[rows.index(arc) :] == [arc, b"FIVE", arc, b"NINE", arc, arc, arc, b"END"]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("G90.1\nG1 X9 Y0 Z.2 F600\nG2 X5 Y5 I9 J5 E1\n", 5),
        ("G1 X9 Y0 Z.2 F600\nG2 X5 Y5 I-4 J0 P2 E1\n", 6),
    ],
)
def test_arcs_that_firmwares_read_differently_are_refused(tmp_path, text, line):
    """Centres from the origin, or several turns in one line, would put beads elsewhere."""
    source = tmp_path / "in.gcode"
    source.write_text(START + text)
    with pytest.raises(InputError) as error:
        read_gcode(source)
    assert error.value.line == line


def test_a_lift_in_a_spiral_is_no_arc_that_prints(tmp_path):
    """OrcaSlicer lifts with `G3 Z I J P1`: a travel, made anew like any other."""
    source = tmp_path / "in.gcode"
    lift = "G3 Z.6 I-1.2 J0 P1 F30000\nG1 X50 Z.2\n"
    source.write_text(START + CIRCLE + lift + "G1 X60 E.3 F900\nG91.1\n")
    job, document, _, out = written(tmp_path, source)
    assert len(turns_of_print(job, document).line) == 1
    assert len(arc_lines(out.read_bytes())) == 1
