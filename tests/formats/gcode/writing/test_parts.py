"""Stretches of contours as a source of their own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.experiments.made_print import made_gcode
from decmcts.formats.gcode import read_gcode
from decmcts.formats.gcode.document import Block
from decmcts.formats.gcode.writing.parts import Stretch, contours_of, with_stretches
from decmcts.print.contours import Contours, joined, taken


def whole(contours: Contours, c: int) -> Stretch:
    rows = np.arange(int(contours.offsets[c]), int(contours.offsets[c + 1]))
    return Stretch(
        c, contours.points[rows], contours.extrusion[rows], contours.feed[rows], rows, whole=True
    )  # fmt: skip


def test_whole_contours_keep_all_they_have(tmp_path: Path) -> None:
    """Their values, states and arcs are those of the source."""
    path = tmp_path / "in.gcode"
    path.write_text(made_gcode([(60, 100)]))
    job, document = read_gcode(path)
    rows = np.array([2, 4, 5])
    rest, text = with_stretches(job, document, [whole(job.contours, c) for c in rows.tolist()])
    due = taken(job.contours, rows)
    for name in Contours.__slots__:
        assert np.array_equal(getattr(rest.contours, name), getattr(due, name)), name
    point = np.concatenate([whole(job.contours, c).row for c in rows.tolist()])
    assert np.array_equal(text.point_state, document.point_state[point])
    assert np.array_equal(text.point_arc, document.point_arc[point])
    assert np.array_equal(text.owed, document.owed[rows])
    assert text.preamble == document.preamble and text.postamble == document.postamble


def test_a_part_of_a_loop_is_no_loop(tmp_path: Path) -> None:
    """And what its contour's begin pushes is pushed already."""
    path = tmp_path / "in.gcode"
    path.write_text(made_gcode([(60, 100)]))
    job, document = read_gcode(path)
    c = int(np.flatnonzero(job.contours.closed)[0])
    all_of = whole(job.contours, c)
    part = replace(
        all_of, points=all_of.points[2:], extrusion=all_of.extrusion[2:], feed=all_of.feed[2:],
        row=all_of.row[2:], whole=False,
    )  # fmt: skip
    assert not contours_of(job.contours, [part]).closed[0]
    _, text = with_stretches(job, document, [part])
    assert text.owed.tolist() == [0.0]


def test_chords_of_a_part_of_an_arc_have_filament_that_words_can_say(tmp_path: Path) -> None:
    """What they rounded off made the filament of a rest differ from its heads' files'."""
    path = tmp_path / "in.gcode"
    path.write_text("G28\nM83\nG1 Z.2 F600\nG1 X120 Y10 F9000\nG3 X20 Y10 I-50 J0 E5.22 F900\n")
    job, document = read_gcode(path)
    all_of = whole(job.contours, 0)
    part = replace(
        all_of, points=all_of.points[9:], feed=all_of.feed[9:], row=all_of.row[9:], whole=False,
        extrusion=np.concatenate([[0.0], all_of.extrusion[10:]]),
    )  # fmt: skip
    laid = with_stretches(job, document, [part])[0].contours.extrusion * 1e5
    assert document.decimals[1] == 5
    assert np.abs(laid - np.round(laid)).max() < 1e-6
    assert laid.sum() == pytest.approx(part.extrusion.sum() * 1e5, abs=0.5)


def test_lines_that_move_and_have_been_run_are_refused(tmp_path: Path) -> None:
    """They would move so once more."""
    path = tmp_path / "in.gcode"
    path.write_text(made_gcode([(60, 100)]))
    job, document = read_gcode(path)
    block = Block(
        0, b"G1 X5 Y5\n", document.start, document.start, moves=True, line=40, reason="moves"
    )
    with pytest.raises(InputError, match="move the head and have been run"):
        with_stretches(job, replace(document, blocks=(block,)), [whole(job.contours, 3)])


def test_two_prints_are_joined(tmp_path: Path) -> None:
    """One behind the other; nothing is joined to one alone."""
    path = tmp_path / "in.gcode"
    path.write_text(made_gcode([(60, 100)]))
    contours = read_gcode(path)[0].contours
    a, b = taken(contours, np.array([0, 1])), taken(contours, np.array([3]))
    both, due = joined(a, b), taken(contours, np.array([0, 1, 3]))
    for name in Contours.__slots__:
        assert np.array_equal(getattr(both, name), getattr(due, name)), name
    assert joined(a, None) is a
