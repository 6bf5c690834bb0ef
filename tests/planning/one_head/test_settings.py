"""Whole commands on prints whose settings are said in parts, for one tool, or in other words."""

from __future__ import annotations

from pathlib import Path

import pytest

from decmcts.cli.run import run
from tests.makers.settings import CASES, laid_under, made

WORDS = ("--machine", "paper", "--time-limit", "0.1", "--planner", "greedy", "--no-certificate")


@pytest.mark.parametrize("name", CASES)
def test_each_line_is_laid_under_the_settings_of_the_source(tmp_path: Path, name: str) -> None:
    """One wrong reading printed lines under another's settings; another refused good results."""
    take, settings = CASES[name]
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_text(made(settings, settings[0] + "\n"))
    due = laid_under(source.read_text(), take)
    assert run(["plan", str(source), "-o", str(out), *WORDS, "--allow-slower"]) == 0
    result = laid_under(out.read_text(), take)
    assert result.keys() == due.keys() == set(range(len(settings)))
    assert list(result) != list(due), "what stays in order shows nothing"
    for k, held in due.items():
        assert held.items() - {("kept", held.get("kept"))} <= result[k].items(), k
