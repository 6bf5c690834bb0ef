"""Who could gain by turning a print is told so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from decmcts.formats.machines.machine_file import load_machine
from decmcts.planning.problem.print_problem import load
from decmcts.planning.team.pipeline import narrow_note, shared
from tests.prints import slab


@pytest.mark.parametrize(
    ("width", "share"), [(50.0, 0.0), (70.0, 0.0), (105.0, 2 / 3), (140.0, 1.0), (300.0, 1.0)]
)
def test_how_much_two_heads_share_of_a_width(width: float, share: float) -> None:
    assert shared(width, 70.0) == pytest.approx(share)


def test_a_long_print_across_the_rail_is_better_turned(tmp_path: Path) -> None:
    job = load(slab(tmp_path / "slab.gcode"), "dual-gantry").job
    machine = load_machine("dual-gantry")
    size = job.contours.points[:, :2].max(axis=0) - job.contours.points[:, :2].min(axis=0)
    assert size[0] > 2 * size[1]
    assert narrow_note(job, machine) is None
    turned = replace(job, contours=replace(job.contours, points=job.contours.points[:, [1, 0, 2]]))
    told = narrow_note(turned, machine)
    assert told is not None and "along y: turned by 90°" in told
    assert narrow_note(turned, load_machine("mk4")) is None
    assert narrow_note(replace(turned, printed=turned.contours), machine) is None
