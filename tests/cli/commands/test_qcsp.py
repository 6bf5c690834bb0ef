"""`decmcts launch X.qcsp`: a judged schedule, one line on what is proven."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from decmcts.cli.run import run
from tests.formats.bare.test_qcsp import TINY


def written(folder: Path, **change: Any) -> Path:
    """Write a small problem; return its path."""
    source = folder / "tiny.qcsp"
    source.write_text(json.dumps(TINY | change))
    return source


@pytest.mark.slow
def test_a_problem_is_solved_and_its_schedule_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The shortest command that leaves a file."""
    target = tmp_path / "out.json"
    assert run(["launch", str(written(tmp_path)), "-o", str(target), "--time-limit", "0.1"]) == 0
    assert "3 tasks, 2 cranes, makespan 8, " in capsys.readouterr().out
    assert json.loads(target.read_text())["makespan"] == 8.0


@pytest.mark.slow
def test_json_says_what_was_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Programs read it; without -o nothing is written."""
    source = written(tmp_path)
    assert run(["launch", str(source), "--time-limit", "0.1", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["schema"], told["makespan"], told["written"]) == ("decmcts-schedule/1", 8.0, [])
    assert list(tmp_path.iterdir()) == [source]


@pytest.mark.parametrize(
    ("change", "extra", "word"),
    [
        ({"p": [4, 3]}, [], "tiny.qcsp: l: 3 values"),
        ({"Phi": [[1, 1]]}, [], "cycle"),
        ({}, ["--machine", "dual-gantry"], "--machine means nothing for a .qcsp file"),
        ({}, ["--report", "r.html"], "--report"),
        ({}, ["--team", "t.toml"], "--team means nothing for a .qcsp file"),
        ({}, ["--no-quality"], "--no-quality"),
        ({}, ["-o", "-", "--json"], "both want standard output"),
    ],
)
def test_what_cannot_be_used_is_one_line(
    change: dict[str, Any],
    extra: list[str],
    word: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Exit code 2, the place, and nothing written."""
    source = written(tmp_path, **change)
    assert run(["launch", str(source), "--time-limit", "0.1", *extra]) == 2
    assert word in capsys.readouterr().err.strip().splitlines()[-1]
    assert list(tmp_path.iterdir()) == [source]


def test_the_input_is_no_output_and_post_is_no_help(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`post` edits G-code in place; for a .qcsp, as for several files, it was advised too."""
    source = written(tmp_path)
    assert run(["launch", str(source), "-o", str(source), "--time-limit", "0.1"]) == 2
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert said.endswith("the output is the input; name another file")
