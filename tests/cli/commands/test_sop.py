"""`decmcts plan X.sop`: a tour beside the file, one line on what is proven."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import pytest

from decmcts.cli.run import run
from tests.formats.bare.test_sop import HEAD, ROWS


@pytest.mark.slow
def test_a_problem_is_solved_and_its_tour_written_beside_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The shortest command that works."""
    source = tmp_path / "tiny.sop.gz"
    source.write_bytes(gzip.compress((HEAD + ROWS).encode()))
    assert run(["plan", str(source), "--time-limit", "1"]) == 0
    said = capsys.readouterr().out
    assert "cost 6.5, proven optimal" in said
    assert "1\n2\n3\n-1\n" in (tmp_path / "tiny.tour").read_text()


@pytest.mark.slow
def test_json_says_what_was_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The benchmark reads it."""
    source, target = tmp_path / "tiny.sop", tmp_path / "mine.tour"
    source.write_text(HEAD + ROWS)
    assert run(["plan", str(source), "-o", str(target), "--time-limit", "1", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["cost"], told["optimal"], told["written"]) == (6.5, True, [str(target)])
    assert target.exists()
    assert not (tmp_path / "tiny.tour").exists()


@pytest.mark.slow
def test_a_bound_of_nothing_is_told_without_a_share(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Circles of no cost bound nothing; without time they are all that is known."""
    source = tmp_path / "circles.sop"
    rows = "0 0 5 5 5\n0 0 5 5 5\n5 5 0 0 5\n5 5 0 0 5\n5 5 5 5 0\n"
    source.write_text(HEAD.replace("N: 3", "N: 5") + rows)
    assert run(["plan", str(source), "--time-limit", "0"]) == 0
    assert "cost 10, bound 0 (" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "extra", "word"),
    [
        (HEAD + "0 4 7\n", [], "tiny.sop:8: 3 costs instead of"),
        (HEAD + "0 -1 -1\n-1 0 2\n-1 -1 0\n", [], "cycle"),
        (HEAD + ROWS, ["-o", "-", "--json"], "both want standard output"),
        (HEAD + ROWS, ["--machine", "mk4s"], "--machine"),
        (HEAD + ROWS, ["--report", "r.html"], "--report"),
        (HEAD + ROWS, ["--no-quality"], "--no-quality"),
        (HEAD + ROWS, ["--planner", "hybrid"], "--planner"),
        (HEAD + ROWS, ["--no-certificate"], "--no-certificate"),
        (HEAD + ROWS, ["--perimeters", "3"], "--perimeters"),
        (HEAD + ROWS, ["--min-layer-time", "0"], "--min-layer-time"),
        (HEAD + ROWS, ["--max-layers-ahead", "0"], "--max-layers-ahead"),
    ],
)
def test_what_cannot_be_used_is_one_line(
    text: str, extra: list[str], word: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2, the place, and nothing written."""
    source = tmp_path / "tiny.sop"
    source.write_text(text)
    assert run(["plan", str(source), "--time-limit", "1", *extra]) == 2
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert word in said
    assert list(tmp_path.iterdir()) == [source]
