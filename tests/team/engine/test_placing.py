"""Where a print that no head can print must be moved to."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from decmcts.cli.run import run
from decmcts.formats.gcode import read_gcode
from decmcts.formats.machines.machine_file import load_machine
from decmcts.team.engine.placing import place_that_fits
from decmcts.team.engine.space import able_heads
from tests.prints import slab

MIDDLE = (82.5, 80.0)


def test_a_print_in_the_way_of_parked_heads_fits_elsewhere(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Heads park in two corners of a small bed; a few millimetres beside its middle is space."""
    path = slab(tmp_path / "in.gcode", wide=96.0, deep=92.0, middle=MIDDLE)
    machine, job = load_machine("dueling-zero"), read_gcode(path)[0]
    assert not able_heads(job, machine).any(axis=1).all()
    place = place_that_fits(job, machine)
    assert place is not None and 0.0 < abs(place[0]) + abs(place[1]) <= 25.0
    points = job.contours.points + np.array([*place, 0.0])
    moved = replace(job, contours=replace(job.contours, points=points))
    assert able_heads(moved, machine).any(axis=1).all()
    assert run(["launch", str(path), "--machine", "dueling-zero", "--time-limit", "1"]) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert f"; move the print by x {place[0]:+g}, y {place[1]:+g} mm" in said


def test_what_is_too_large_for_every_place_is_not_sent_elsewhere(tmp_path: Path) -> None:
    """A loop nearly as large as the bed leaves no space to park in."""
    path = slab(tmp_path / "in.gcode", wide=150.0, deep=140.0, middle=MIDDLE)
    assert place_that_fits(read_gcode(path)[0], load_machine("dueling-zero")) is None
