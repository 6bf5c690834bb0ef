"""Contacts that the source makes itself, as the judge finds and allows them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from decmcts.formats.gcode import read_gcode, read_motions
from decmcts.formats.machines.machine_file import load_machine
from sim.faults import FaultKind
from sim.replay.contacts import source_meetings
from tests.makers.scarf import scarf_gcode
from tests.mutants.contacts import CONTACT_MUTANTS
from tests.sim.files.motions import verify_motions

KINDS = {
    "the ramp before the wall it touches": FaultKind.PRECEDENCE,
    "the ramp into another bead": FaultKind.HEAD_MATERIAL,
    "the ramp reversed": FaultKind.WRONG_PATH,
    "a contact deeper than the source's": FaultKind.HEAD_MATERIAL,
    "a travel through the wall at the ramp's height": FaultKind.HEAD_MATERIAL,
}
TWO = [(60.0, 60.0), (130.0, 60.0)]


def judged(tmp_path: Path, text: str, machine: str = "mk4s"):
    source, result = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_text(scarf_gcode(TWO))
    result.write_text(text)
    job, document = read_gcode(source)
    return verify_motions(read_motions(result), document.moves, load_machine(machine), job=job)


def test_scarf_seams_meet_the_wall_beside_them_and_nothing_below(tmp_path: Path):
    """Each outer wall meets the inner wall of its layer, half a layer deep."""
    (tmp_path / "in.gcode").write_text(scarf_gcode(TWO[:1]))
    contours = read_gcode(tmp_path / "in.gcode")[0].contours
    machine = load_machine("mk3s")
    found = source_meetings(contours, machine, machine.heads[0], 1e-3)
    assert found.ordered.tolist() == [[3 * k + 1, 3 * k] for k in range(4)]
    assert found.depth[found.beside] == pytest.approx(np.full(4, 0.1))


@pytest.mark.parametrize("machine", ["mk4s", "voron24-300", "mk3s"])
def test_a_file_with_scarf_seams_is_sound(tmp_path: Path, machine: str):
    """What the slicer does itself may stay, whatever the machine."""
    verdict = judged(tmp_path, scarf_gcode(TWO), machine)
    assert verdict.ok, verdict.shown


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("mutant", CONTACT_MUTANTS, ids=lambda m: m.name)
def test_contacts_that_the_source_does_not_make_are_faults(tmp_path: Path, mutant, seed: int):
    """Deeper, with another bead, in another order or direction: none is the slicer's."""
    lines = scarf_gcode(TWO).splitlines()
    mutant.spoil(lines, np.random.default_rng(seed))
    verdict = judged(tmp_path, "\n".join(lines) + "\n")
    assert KINDS[mutant.name] in verdict.kinds(), verdict.shown
