"""Real files with arcs: as many come out as went in, and the files stay as long."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from decmcts.formats.gcode import read_gcode, read_motions, write_gcode
from decmcts.formats.gcode.text.source_text import load_text
from sim.content.arcs import check_arcs, turns_of, turns_of_print
from sim.content.seams import seams_of_plan
from tests.direct_actions import direct_actions
from tests.formats.gcode.conftest import toolpath_of
from tests.makers.corpus import CORPUS
from tests.print.test_loops import random_entries

WELDED = (
    "prusaslicer_2.4.0a1_m486_arcwelder_crlf.gcode.gz",
    "prusaslicer_2.7.4_arcs_plantsign.gcode.gz",
    "prusaslicer_2.7.4_arcs_screw.gcode.gz",
    "prusaslicer_2.9.1_arcs_testgeometry.gcode.gz",
    "superslicer_2.3.56_klipper_arcs_crlf.gcode.gz",
    "bambustudio_1.8.2.56_twocolour_single.gcode.gz",
)
pytestmark = [pytest.mark.shared, pytest.mark.slow, pytest.mark.usefixtures("needs_corpus")]


@pytest.mark.parametrize("name", WELDED)
def test_arcs_in_are_arcs_out(tmp_path, name):
    """In any order and direction; with other seams none becomes chords but where it is parted."""
    source, out = CORPUS / "gcode" / name, tmp_path / "out.gcode"
    job, document = read_gcode(source)
    due = turns_of_print(job, document)
    assert len(due.line) > 100
    for seed, seams in ((None, False), (1, False), (2, True)):
        path = toolpath_of(job, seed)
        if seams:
            path = replace(path, entry=random_entries(job.contours, 2)[path.order])
        actions = direct_actions(job, path)
        write_gcode(document, job, actions, out)
        moved = {seam.contour for seam in seams_of_plan(actions)}
        ours = turns_of(read_motions(out), all_moves=False)
        assert check_arcs(ours, due, moved) == []
        if not seams:
            assert len(ours.line) == len(due.line)
            assert ours.extrusion.sum() == pytest.approx(due.extrusion.sum(), abs=1e-4)
        assert _moves(out) <= 1.3 * _moves(source)  # wipes and travels are made anew


def _moves(path: Path) -> int:
    return len(re.findall(rb"^G[0123] ", load_text(path), re.M))


def test_centres_fit_both_ends_as_well_as_in_the_source(tmp_path):
    """Firmwares refuse arcs whose ends are at unequal distances from the centre."""
    source, out = CORPUS / "gcode" / WELDED[1], tmp_path / "out.gcode"
    job, document = read_gcode(source)
    write_gcode(document, job, direct_actions(job, toolpath_of(job, 1)), out)
    worst = [_misfit(read_motions(path)) for path in (source, out)]
    assert worst[1] <= worst[0] + 1e-6


def _misfit(motions) -> float:
    turns = turns_of(motions, all_moves=False)
    radii = [np.linalg.norm(turns.ends[:, at] - turns.centre, axis=1) for at in ([0, 1], [3, 4])]
    return float(np.abs(radii[0] - radii[1]).max())
