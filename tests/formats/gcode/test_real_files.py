"""The corpus of real prints: every file round-trips or is refused by name."""

from __future__ import annotations

import csv
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from decmcts.formats.gcode import Motions, read_gcode, read_motions
from decmcts.formats.gcode.dialects.stated_times import without_progress
from decmcts.formats.machines.machine_file import load_machine
from decmcts.planning.verify import verify
from sim.faults import FaultKind
from sim.files.written import verify_written
from tests.makers.corpus import CORPUS


def corpus(folder: str, pattern: str) -> list[Path]:
    """Return files of the corpus, a missing one when there is no corpus."""
    found = sorted((CORPUS / folder).glob(pattern))
    return found or [CORPUS / folder / "absent"]


pytestmark = [pytest.mark.shared, pytest.mark.long, pytest.mark.usefixtures("needs_corpus")]


@pytest.mark.parametrize("path", corpus("gcode", "*.gcode.gz"), ids=lambda p: p.name)
def test_files_of_a_dozen_slicers(path, again, tmp_path):
    """Same segments, feeds and machine state in the source's order and in another.

    And one judge: filament, commands and states of what is written pass `verify --source` too.
    """
    job, document = read_gcode(path)
    job2, document2, _ = again(job, document)
    out, machine = tmp_path / "out.gcode", load_machine("paper")
    draft = verify_written(out, job, document, machine, seams=[])
    assert not draft.kinds() & {FaultKind.STATE, FaultKind.E_TOTAL, FaultKind.COMMAND}
    assert verify(out, path, machine, seed=0, trials=1).faults == draft.faults
    assert job2.contours.epoch.tolist() == job.contours.epoch.tolist()
    blocks = [b"".join(without_progress(block.text)) for block in document.blocks]
    assert [block.text for block in document2.blocks] == blocks
    due = by_tool(document.moves)
    assert by_tool(read_motions(out)) == pytest.approx(due, abs=1e-4)
    again(job, document, seed=1, seams=True)
    assert by_tool(read_motions(out)) == pytest.approx(due, abs=1e-4)


def by_tool(motions: Motions) -> np.ndarray:
    """Return the filament each tool gives in all, mm."""
    return np.bincount(motions.tool, motions.extrusion)


@pytest.mark.parametrize("path", corpus("gcode", "*.bgcode"), ids=lambda p: p.name)
def test_binary_gcode_has_the_contours_of_its_text_twin(path):
    """The twin is the same print exported as text; each bead must be found in both."""
    ours = read_gcode(path)[0].contours
    theirs = read_gcode(path.with_suffix(".gcode.gz"))[0].contours
    for name in ("points", "offsets", "extrusion", "feed", "width", "height", "role", "epoch"):
        assert np.array_equal(getattr(ours, name), getattr(theirs, name)), name


@pytest.mark.parametrize("path", corpus("models/gcode", "*.gcode.gz"), ids=lambda p: p.name)
def test_models(path, again):
    """63 models: contours as counted by another program, and the round trip."""
    job, document = read_gcode(path)
    with (CORPUS / "models/manifest.csv").open() as file:
        rows = {row["name"]: row for row in csv.DictReader(file)}
    assert len(job.contours) == int(rows[path.name.split(".")[0]]["contours"])
    job2, _, _ = again(job, document)
    assert Counter(job2.contours.role.tolist()) == Counter(job.contours.role.tolist())
