"""Every reader takes steps and memory in proportion to what it reads, whatever is repeated."""

from __future__ import annotations

from pathlib import Path

import pytest

from decmcts.cli.commands.replay import read_record
from decmcts.errors import InputError
from decmcts.formats.bare.qcsp import read_qcsp
from decmcts.formats.bare.sop import read_sop
from decmcts.formats.gcode import read_gcode
from decmcts.formats.machines.machine_file import load_machine
from decmcts.formats.mesh.load import load_solid
from decmcts.formats.mesh.options import Bed
from decmcts.formats.plans.plan_json import read_plan
from sim.files.written import verify_written
from tests.growth.counted import grows_faster, peak_bytes, steps
from tests.growth.inputs import BEYOND, FILES

FIRST, DOUBLED = 24, 2  # repetitions of the smallest input, and how often they are doubled
LEAST_STEPS, LEAST_BYTES = 600, 60_000  # of growth that counts


def read(path: Path) -> None:
    """Read a file with the reader of its kind, and judge G-code as its own result."""
    kind = path.name.partition(".")[2]
    try:
        if kind.startswith(("toml", "ini", "json:")) or path.name == "own.json":
            load_machine(str(path))
        elif kind == "json":
            read_plan(path)
        elif kind == "stl":
            load_solid(path, Bed())
        elif kind == "rec":
            read_record(path)
        elif kind == "sop":
            read_sop(path)
        elif kind == "qcsp":
            read_qcsp(path)
        else:
            job, document = read_gcode(path)
            verify_written(path, job, document, load_machine("paper"))
    except InputError:
        return


@pytest.mark.parametrize(("name", "file"), FILES, ids=lambda word: word.replace(" ", "_"))
def test_repetitions_cost_what_they_hold(tmp_path: Path, name: str, file: str) -> None:
    """Doubled twice: the second doubling costs twice what the first did."""
    make, path = FILES[name, file], tmp_path / file
    took, held, first = list[int](), list[int](), BEYOND.get(name, FIRST)
    for k in range(DOUBLED + 1):
        (tmp_path / file.partition(":")[0]).write_bytes(make(first * 2**k))
        if not k:
            read(path)  # the first time something is loaded, or compiled
        took.append(steps(lambda: read(path)))
        held.append(peak_bytes(lambda: read(path)))
    assert not grows_faster(took, slack=1.25, least=LEAST_STEPS), took
    assert not grows_faster(held, slack=1.25, least=LEAST_BYTES), held
