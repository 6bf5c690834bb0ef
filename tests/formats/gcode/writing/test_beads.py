"""Beads formatted together are those written segment by segment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decmcts.formats.gcode import read_gcode
from decmcts.formats.gcode.writing.beads import BeadRows, rounded
from decmcts.formats.gcode.writing.emitter import Emitter
from decmcts.formats.gcode.writing.writer import print_contour

MODES = ("M83\nG92 E0\n", "M82\nG92 E0\n")


def text_of(mode: str) -> str:
    """Return a print of plain contours, with others: two feeds, a slope, a dot, two states."""
    rng, rows, e = np.random.default_rng(3), [f"G90\n{mode}G1 Z.2 F600\n"], 0.0
    for k in range(12):
        rows.append(f"G0 X{10 * k} Y0 F9000\n")
        if k == 9:
            rows.append("M106 S99\n")
        for n in range(1, 6):
            given = round(float(rng.random()) / 3, 5)
            e = e + given if "M82" in mode else given
            z = " Z.25" if k == 7 and n == 3 else ""
            feed = " F1200" if n == 1 else " F1500" if k == 8 and n == 4 else ""
            x, y = 10 * k + rng.random() * 5, n + rng.random()
            rows.append(f"G1 X{x:.3f} Y{y:.3f}{z} E{e:.5f}{feed}\n")
    return "".join(rows)


@pytest.mark.parametrize("mode", MODES, ids=["relative E", "absolute E"])
def test_plain_contours_are_written_as_segment_by_segment(tmp_path, mode):
    """To the byte, forwards and reversed, with what is rounded off carried on."""
    source = tmp_path / "in.gcode"
    source.write_text(text_of(mode))
    job, document = read_gcode(source)
    beads = BeadRows.of(document, job)
    assert 8 < sum(beads.plain) < len(beads.plain)
    texts = []
    for each in (beads, replace(beads, plain=[False] * len(beads.plain))):
        emitter = Emitter(document, job.settings)
        for contour in range(len(job.contours)):
            print_contour(emitter, each, contour, [], is_reversed=contour % 2 == 1, entry=0)
        texts.append(emitter.text())
    assert texts[0] == texts[1]
    assert texts[0].count(b" E") >= 60


@given(st.lists(st.floats(-1e12, 1e12)), st.integers(0, 6))
def test_numbers_are_rounded_as_python_rounds_them(values, digits):
    """Else a digit of some later push would differ."""
    ties = [*values, *(round(v, digits) + 0.5 * 10.0**-digits for v in values)]
    assert rounded(np.array(ties), digits).tolist() == [round(v, digits) for v in ties]
