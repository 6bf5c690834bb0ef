"""Temperatures at each bead, as the judge reads them itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from decmcts.formats.gcode import read_gcode
from decmcts.formats.gcode.controller.held import Targets
from decmcts.formats.machines.machine_file import load_machine
from sim.files.temperatures import check_temperatures
from sim.files.written import verify_written
from tests.makers.one_by_one import one_by_one

SOURCE = b"M104 S200\nM109 S200\nG1 X1 E1\nM104 S200\nG1 X2 E1\nM104 S195\nG1 X3 E1\n"


def faults(text: bytes, line: list[int], source: bytes = SOURCE) -> list[str]:
    """Return the faults of a file that lays the source's three beads at these lines."""
    rows = [k for k, row in enumerate(source.split(b"\n"), 1) if row.startswith(b"G1")]
    return [f.text for f in check_temperatures(text, source, np.array(line), np.array(rows))]


def test_a_target_said_once_more_may_be_left_out():
    """The heater does the same."""
    text = b"M104 S200\nM109 S200.0\nG1 X2 E1\nG1 X1 E1\nM104 S195\nG1 X3 E1\n"
    assert faults(text, [4, 3, 6]) == []


@pytest.mark.parametrize(
    ("old", "new"),
    [(b"S195", b"S194"), (b"M104 S195\n", b""), (b"S195", b"S195 T1"), (b"M104", b"M140")],
)
def test_a_real_change_is_missed(old: bytes, new: bytes):
    """Another value, none, or that of another heater."""
    text = b"M109 S200\nG1 X1 E1\n;\nG1 X2 E1\n" + b"M104 S195\n".replace(old, new) + b"G1 X3 E1\n"
    assert len(faults(text, [2, 4, 6 if new else 5])) == 1


def test_behind_a_macro_the_target_is_not_known():
    """Said once more behind a macro it is no repetition: the macro may have changed it."""
    source = b"M109 S200\nG1 X1 E1\nPURGE\nM104 S200\nG1 X2 E1\nG1 X3 E1\n"
    kept = faults(source, [2, 5, 6], source)
    left_out = faults(b"M109 S200\nG1 X1 E1\nPURGE\n;\nG1 X2 E1\nG1 X3 E1\n", [2, 5, 6], source)
    assert kept == []
    assert left_out == [
        f"line {k} is printed with the hot end 0 as command 1 that may heat left it, in the source "
        f"at 200 degrees (line {k} there)"
        for k in (5, 6)
    ]


def test_a_bead_moved_across_a_change_is_seen():
    """The first bead is laid at the third's temperature."""
    text = b"M109 S200\nG1 X2 E1\nM104 S195\nG1 X3 E1\nG1 X1 E1\n"
    assert len(faults(text, [5, 2, 4])) == 1


@pytest.mark.slow
def test_a_reader_that_takes_changes_for_repetitions_is_found_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The judge reads files with the planner's reader, so it keeps a book of its own."""
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_text(one_by_one(2, ("M104 S205",)))
    monkeypatch.setattr(Targets, "again", lambda *_: True)
    job, document = read_gcode(source)
    out.write_text(one_by_one(2, ("M104 S210",)))
    verdict = verify_written(out, job, document, load_machine("rail-3"))
    assert any("205" in fault.text for fault in verdict.faults), verdict.shown


def test_homing_may_cool_a_nozzle_but_no_bed():
    """Printers that probe with the nozzle cool it for that."""
    source = b"M140 S60\nM104 S200\nG28\nM104 S200\nM140 S60\nG1 X1 E1\n"
    assert faults(b"M140 S60\nM104 S200\nG28\nM104 S200\nG1 X1 E1\n", [5], source) == []
    assert len(faults(b"M140 S60\nM104 S200\nG28\nM140 S60\nG1 X1 E1\n", [5], source)) == 1
