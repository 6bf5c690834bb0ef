"""`decmcts experiment`: listed, refused, run."""

from __future__ import annotations

from pathlib import Path

import pytest

from decmcts.cli.run import run
from decmcts.experiments.made_print import made_gcode
from decmcts.experiments.run import EXPERIMENTS


def test_without_a_name_all_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    """With the question each answers."""
    assert run(["experiment"]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in listed] == list(EXPERIMENTS)
    assert all(line.endswith("?") for line in listed)


@pytest.mark.parametrize(
    "words", [["two-hats"], ["paper", "--prints", "none"], ["paper", "--cluster", "nowhere://x"]]
)
def test_what_is_not_there_is_one_line(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """And nothing is written."""
    monkeypatch.chdir(tmp_path)
    assert run(["experiment", *words]) == 2
    said = capsys.readouterr().err
    assert said.startswith("decmcts: ") and len(said.splitlines()) == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_run_that_fails_makes_the_exit_code_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The others' rows are there all the same."""
    own = tmp_path / "own"
    own.mkdir()
    (own / "a.gcode").write_text(made_gcode([(60, 100), (240, 100)], layers=2))
    (own / "b.gcode").write_text(made_gcode([(60, 100), (900, 100)], layers=2))
    words = ["two-heads", "--prints", str(own), "-o", str(tmp_path / "out"), "--iterations", "1"]
    assert run(["experiment", *words, "--jobs", "1"]) == 1
    said = capsys.readouterr()
    assert "4 runs, 2 failed" in said.out and "| a | none |" in said.out
    assert "b.gcode" in said.err
