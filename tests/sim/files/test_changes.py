"""Files that change tools less often than their source, and how they can be wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from decmcts.formats.gcode import read_gcode
from decmcts.formats.machines.machine_file import load_machine
from decmcts.planning.events import unheard
from decmcts.planning.options import RULES
from decmcts.planning.problem.fewer_changes import with_fewer_changes
from decmcts.planning.problem.source import Source
from sim.faults import Verdict
from sim.files.changes import as_taken
from sim.files.written import verify_written
from tests.makers.changes import two_colours
from tests.mutants.tools import CHANGE_MUTANTS

Made = tuple[Source, str]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """Return a source and the text with fewer changes that is made of it."""
    path = tmp_path_factory.mktemp("changes") / "in.gcode"
    path.write_text(two_colours(layers=6))
    job, document = read_gcode(path)
    source = Source(path, job, document, load_machine("mk4s"))
    found = with_fewer_changes(source, RULES, unheard)
    assert found.regrouped is not None
    return source, Path(found.document.path).read_text()


def judged(made: Made, text: str, folder: Path) -> Verdict:
    source, _ = made
    (folder / "out.gcode").write_text(text)
    return verify_written(folder / "out.gcode", source.job, source.document, source.machine)


def test_fewer_changes_pass(made: Made, tmp_path: Path):
    """A judge that faults everything would catch every mutant."""
    assert judged(made, made[1], tmp_path).ok
    assert made[1].count("\nT") < made[0].path.read_text().count("\nT")


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("mutant", CHANGE_MUTANTS, ids=lambda m: m.name)
def test_spoilt_changes_do_not_pass(made: Made, tmp_path: Path, mutant, seed: int):
    """Each kind is caught."""
    lines = made[1].split("\n")
    mutant.spoil(lines, np.random.default_rng(seed))
    assert not judged(made, "\n".join(lines), tmp_path).ok


def test_a_file_with_the_sources_changes_is_judged_by_the_source(made: Made):
    """Nothing is taken otherwise where nothing changed."""
    job, document = made[0].job, made[0].document
    own = np.arange(len(job.contours), dtype=np.int64)
    assert as_taken(own, job, document, document.moves) is None
