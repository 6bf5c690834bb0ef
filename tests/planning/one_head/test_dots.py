"""Dots and vertical beads from file to file, for one head and for two, and spoilt on purpose."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from decmcts.cli.run import run
from decmcts.formats.gcode import read_gcode, read_motions
from sim.experiments.gcode_lines import rows_of
from sim.experiments.made_dots import made_dots_gcode
from sim.experiments.mutants_dots import DOT, DOT_MUTANTS, HEAD_DOT_MUTANTS, PILLAR


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """A plate planned for one head: its source, and the file that was written."""
    folder = tmp_path_factory.mktemp("dots")
    source, out = folder / "in.gcode", folder / "out.gcode"
    source.write_text(made_dots_gcode((30, 150)))
    options = ["--machine", "mk4s", "--time-limit", "0.5", "--planner", "greedy", "--allow-slower"]
    assert run(["plan", str(source), "-o", str(out), *options]) == 0
    return source, out


def verified(out, source):
    return run(["verify", str(out), "--source", str(source), "--machine", "mk4s"])


@pytest.mark.slow
def test_what_goes_in_comes_out(planned):
    """Every dot and every pillar, with all its filament: they were lost and called verified."""
    source, out = planned
    text = out.read_text()
    assert (
        len(rows_of(text.splitlines(), DOT)) == 6 and len(rows_of(text.splitlines(), PILLAR)) == 4
    )
    pushed = [read_motions(path).extrusion.sum() for path in planned]
    assert pushed[0] == pytest.approx(pushed[1], abs=1e-4)
    assert verified(out, source) == 0


@pytest.mark.slow
@pytest.mark.parametrize("mutant", DOT_MUTANTS, ids=lambda m: m.name)
def test_spoilt_it_is_refused(planned, tmp_path, mutant):
    """The judge counts what is pushed on the spot and while the nozzle climbs by itself."""
    source, out = planned
    lines = out.read_text().splitlines()
    mutant.spoil(lines, np.random.default_rng(0))
    other = tmp_path / "spoilt.gcode"
    other.write_text("\n".join(lines) + "\n")
    assert verified(other, source) == 1


@pytest.mark.slow
def test_two_heads_share_dots_and_pillars(tmp_path):
    """A dot takes time where the head stands; the files keep it, and are judged with the plan."""
    source, stem, plan = tmp_path / "in.gcode", tmp_path / "out", tmp_path / "plan.json"
    source.write_text(made_dots_gcode((30, 240)))
    machine = ["--machine", "dual-gantry"]
    options = [*machine, "--time-limit", "1", "--plan", str(plan)]
    assert run(["launch", str(source), "-o", str(stem), *options]) == 0
    files = sorted(str(path) for path in tmp_path.glob("out_*.gcode"))
    texts = "".join(Path(path).read_text() for path in files)
    assert (
        len(rows_of(texts.splitlines(), DOT)) == 6 and len(rows_of(texts.splitlines(), PILLAR)) == 4
    )
    assert run(["verify", *files, "--source", str(source), "--plan", str(plan), *machine]) == 0
    assert run(["verify", *files, "--source", str(source), *machine]) == 0
    assert run(["verify", str(plan), "--source", str(source), *machine]) == 0
    assert len(read_gcode(source)[0].contours) == 20
    good = [Path(path).read_text().splitlines() for path in files]
    for mutant in HEAD_DOT_MUTANTS:
        spoilt = [list(lines) for lines in good]
        mutant.spoil(spoilt, np.random.default_rng(0))
        for path, lines in zip(files, spoilt, strict=True):
            Path(path).write_text("\n".join(lines) + "\n")
        judged = ["verify", *files, "--source", str(source), "--plan", str(plan), *machine]
        assert run(judged) == 1, mutant.name
