"""Heads drawn as near as they may be, checked with the judge's bodies."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from decmcts.formats.machines.machine_file import load_machine
from decmcts.print.machine import Machine
from sim.pictures.machine_picture import draw_machine
from sim.pictures.row_picture import HeadsInRow, row_of
from sim.replay.shapes import Solid, parts_of
from tests.makers.random_machines import random_machine


def by_fcl(machine: Machine, row: HeadsInRow, one: int, other: int, nearer: float = 0.0) -> float:
    """Return the distance of two heads of a row, the second moved towards the first."""
    places = row.nozzles.copy()
    places[other, row.axis] -= nearer
    solids = [
        [Solid(part.vertices() + np.append(places[k], 0.0)) for part in parts_of(machine.heads[h])]
        for k, h in ((one, row.order[one]), (other, row.order[other]))
    ]
    return min(a.distance(b) for a, b in itertools.product(*solids))


def rows_of(machine: Machine) -> list[HeadsInRow]:
    return [row for axis in range(2) if (row := row_of(machine, axis)) is not None]


MACHINES = [load_machine(name) for name in ("dual-gantry", "dueling-zero", "rail-4")]


@pytest.mark.parametrize(
    "machine", [*MACHINES, *map(random_machine, range(6))], ids=lambda m: m.name
)
def test_what_is_drawn_is_the_nearest_by_the_judge(machine):
    """All keep the clearance, neighbours just so; a rail that asks for more is kept as exactly."""
    for row in rows_of(machine):
        n, due = len(row.order), machine.head_clearance_mm
        for one, other in itertools.combinations(range(n), 2):
            assert by_fcl(machine, row, one, other) > due - 1e-4
        for k, gap in enumerate(row.gaps_mm):
            assert gap == pytest.approx(by_fcl(machine, row, k, k + 1), abs=1e-4)
            if not row.by_rail[k]:
                assert any(
                    by_fcl(machine, row, j, k + 1, nearer=0.01) < due - 1e-4 for j in range(k + 1)
                )
        for rail in machine.rails:
            at = {machine.heads[h].name: row.nozzles[k, rail.axis] for k, h in enumerate(row.order)}
            steps = np.diff([at[name] for name in rail.order])
            assert (steps >= rail.separation_mm - 1e-9).all()


def test_which_rows_there_are():
    """On a rail along x nobody stands behind another; heads that may pass do."""
    dual, dueling, rail = MACHINES
    assert [row.axis for row in rows_of(dual)] == [0]
    assert [row.axis for row in rows_of(dueling)] == [0, 1]
    (row,) = rows_of(rail)
    assert row.order == (0, 1, 2, 3)
    np.testing.assert_allclose(np.diff(row.nozzles[:, 0]), 70.0)
    np.testing.assert_allclose(row.gaps_mm, 10.0)
    assert rows_of(load_machine("mk4s")) == []
    beside, behind = rows_of(dueling)
    assert np.ptp(beside.nozzles[:, 0]) == pytest.approx(40.5)
    assert np.ptp(behind.nozzles[:, 1]) == pytest.approx(53.5)
    assert all(gap == pytest.approx(0.5) for row in (beside, behind) for gap in row.gaps_mm)


@pytest.mark.slow
def test_the_picture_names_heads_rails_and_distances(tmp_path):
    """Words of an SVG are words: who stands where, and how far apart."""
    draw_machine(MACHINES[0], tmp_path / "m.svg")
    text = (tmp_path / "m.svg").read_text()
    for words in (
        "as near side by side as they may: from above", "the same from the front", "10 mm", "70 mm",
        "rail along x: left, right; nozzles 70 mm apart", "left: park, reach", "x, mm", "z from",
        "left and right: bodies 10 mm, nozzles 70 mm (their rail)", "dual-gantry",
    ):  # fmt: skip
        assert words in text, words
