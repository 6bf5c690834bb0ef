"""The keys programs rely on; docs/json-output.md describes them."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from decmcts.cli.console import print_json
from decmcts.cli.run import run
from tests.cli.test_bad_input import SQUARE, gcode

RESULT = {
    "schema", "input", "machine", "slicer", "edges", "barriers", "notes", "seconds", "before",
    "after", "gain", "file_time_s", "verified", "written", "kept_source",
    "made_safe", "planned_already", "sliced_by",
}  # fmt: skip
DOCUMENTED = Path(__file__).parents[2] / "docs" / "json-output.md"


def said(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    """Run a command with --json and return what it says."""
    assert run([*arguments, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert f"`{summary['schema']}`" in DOCUMENTED.read_text()
    assert isinstance(summary, dict)
    return summary


def test_every_key_of_a_result_is_documented() -> None:
    """A key nobody can look up is a guess."""
    words = DOCUMENTED.read_text()
    assert all(f"`{key}`" in words for key in RESULT - {"schema"})


@pytest.mark.slow
def test_a_result_has_its_keys(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`plan` and `post` say the same of the same; `post` after the file is rewritten."""
    source, made = tmp_path / "part.gcode", tmp_path / "out.gcode"
    source.write_text(gcode(SQUARE))
    words = [str(source), "--machine", "paper", "--time-limit", "0.1", "--allow-slower"]
    planned = said(["plan", *words, "-o", str(made)], capsys)
    assert set(planned) == RESULT
    assert planned["schema"] == "decmcts-result/1"
    assert planned["written"] == [str(made)]
    assert {"read", "graph", "plan", "verify", "bound", "write"} == set(planned["seconds"])
    assert planned["gain"]["print_time_s"].keys() == {"before", "after", "less_percent"}
    posted = said(["post", *words], capsys)
    assert set(posted) == RESULT
    assert posted["written"] == [str(source)]
    verdict = said(
        ["verify", str(made), "--source", str(source), "--machine", "paper"], capsys
    )  # same extrusions
    keys = {"schema", "file", "ok", "faults", "checked", "warnings", "counts", "nearest"}
    assert verdict.keys() == keys
    assert (verdict["schema"], verdict["ok"]) == ("decmcts-verdict/1", True)
    assert verdict["counts"].keys() == {"moves", "segments"}
    assert verdict["nearest"]["heads"] is None
    assert verdict["nearest"]["beside"].keys() == {"mm", "at_least", "required_mm", "heads", "at"}


def test_machines_have_their_keys(capsys: pytest.CaptureFixture[str]) -> None:
    """A program offers its user the machines there are."""
    listed = said(["machines"], capsys)
    assert listed["schema"] == "decmcts-machines/1"
    keys = {"name", "source", "bed_min", "bed_max", "heads", "slices_mm"}
    assert all(machine.keys() == keys for machine in listed["machines"])
    assert "mk4s" in {machine["name"] for machine in listed["machines"]}


def test_what_json_has_no_word_for_is_null(capsys: pytest.CaptureFixture[str]) -> None:
    """`Infinity` is no JSON: parsers refuse the whole summary for it."""
    print_json("decmcts-result/1", {"a": math.inf, "b": [np.float64("nan"), np.int64(3)]})
    assert json.loads(capsys.readouterr().out) == {
        "schema": "decmcts-result/1", "a": None, "b": [None, 3.0],
    }  # fmt: skip
