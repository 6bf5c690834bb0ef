"""A file we wrote is a source like any other; what we said in it is not said twice."""

from __future__ import annotations

from pathlib import Path

import pytest

from decmcts.cli.run import run
from tests.planning.problem.test_first_check import LAYERS

WORDS = ["--machine", "paper", "--time-limit", "0.1", "--allow-slower"]


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_a_second_run_replaces_what_the_first_said(tmp_path: Path, newline: str) -> None:
    """Travel and time of an earlier run, left in a header, would be read as this file's."""
    source, once, twice = (tmp_path / f"{name}.gcode" for name in ("source", "once", "twice"))
    source.write_text(LAYERS, newline=newline)
    assert run(["plan", str(source), "-o", str(once), *WORDS]) == 0
    assert run(["plan", str(once), "-o", str(twice), *WORDS]) == 0
    for written in (once, twice):
        lines = written.read_text().splitlines()
        assert sum(line.startswith("; reordered by decmcts") for line in lines) == 1
        assert sum(line.startswith("; verified: every extrusion") for line in lines) == 1
    assert run(["verify", str(twice), "--source", str(once), "--machine", "paper"]) == 0
    assert run(["verify", str(twice), "--source", str(source), "--machine", "paper"]) == 0
