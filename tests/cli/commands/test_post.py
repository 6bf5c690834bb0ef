"""`decmcts post`: what a slicer's log says, and what stands beside the exported file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from decmcts.cli.run import run
from decmcts.errors import InputError
from decmcts.planning.problem.source import NAME
from decmcts.planning.result import Result
from tests.planning.problem.test_first_check import LAYERS

QUICK = ["--machine", "paper", "--planner", "greedy", "--allow-slower"]


@pytest.fixture
def views(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Keep the places of views; each is a short text, for drawing takes a second."""
    places: list[Path] = []

    def write(result: Result, path: Path, **_layer: int | None) -> None:
        places.append(path)
        path.write_text(f"decmcts {result.source.name}")

    monkeypatch.setattr(Result, "write_report", write)
    monkeypatch.setattr(Result, "write_picture", write)
    return places


@pytest.fixture
def part(tmp_path: Path) -> Path:
    path = tmp_path / "part.gcode"
    path.write_text(LAYERS)
    return path


def test_views_stand_next_to_the_file_and_the_last_lines_say_where(
    part: Path, views: list[Path], capsys
) -> None:
    """The maker looks at the end of a log; the file comes behind the options."""
    assert run(["post", *QUICK, "--picture", "--report", str(part)]) == 0
    said = capsys.readouterr()
    report, picture = part.with_name("part.report.html"), part.with_name("part.picture.png")
    assert views == [report, picture]
    assert said.out.splitlines()[-2:] == [f"wrote {report}", f"wrote {picture}"]


def test_views_have_the_name_that_the_file_gets(
    part: Path, views: list[Path], monkeypatch, capsys
) -> None:
    """The slicer handed over a copy; its own name is also in the title and in the log."""
    final = part.parent / "exported" / "cup.gcode"
    final.parent.mkdir()
    monkeypatch.setenv(NAME, str(final))
    assert run(["post", *QUICK, "--report", str(part)]) == 0
    assert views == [final.parent / "cup.report.html"]
    assert views[0].read_text() == "decmcts cup.gcode"
    said = capsys.readouterr().out.splitlines()
    assert said[0].startswith("cup.gcode: rewritten for paper and verified")
    assert said[-1] == f"wrote {views[0]}"


@pytest.mark.slow
def test_a_log_is_short_and_plain(part: Path, capsys) -> None:
    """No table, no steps; each figure once. Who wants more asks for it."""
    assert run(["post", *QUICK, str(part)]) == 0
    said = capsys.readouterr()
    assert said.err == ""
    lines = said.out.splitlines()
    assert 3 <= len(lines) <= 6 and not set("┃│━") & set(said.out)
    assert [line.split(":")[0] for line in lines[1:3]] == ["print time", "travel"]
    part.write_text(LAYERS)
    assert run(["post", *QUICK, "-v", str(part)]) == 0
    said = capsys.readouterr()
    assert "reading part.gcode" in said.err and "reading part.gcode back" not in said.err
    assert f"reading {part} back and judging it (3 of 3)" in said.err
    assert "planner greedy" in said.out and "travel between contours" in said.out


@pytest.mark.parametrize("view", ["report", "picture"])
def test_a_view_that_cannot_be_written_costs_nothing(
    part: Path, views: list[Path], monkeypatch, capsys, view: str
) -> None:
    """The export goes on with the better file."""

    def full(result: Result, path: Path, **_layer: int | None) -> None:
        raise InputError("cannot be written (No space left on device)", path=path)

    monkeypatch.setattr(Result, f"write_{view}", full)
    assert run(["post", *QUICK, "--report", "--picture", str(part)]) == 0
    assert part.read_text() != LAYERS
    said = capsys.readouterr()
    assert "No space left" in said.err.replace("\n", " ")
    assert len(views) == 1 and said.out.splitlines()[-1] == f"wrote {views[0]}"


def test_a_view_of_another_kind_is_refused_before_the_work(part: Path, capsys) -> None:
    """So is one that would be the G-code itself, or has no folder; nothing is touched."""
    for words in (["--report=p.png"], ["--picture=p.html"], [f"--report={part}"],
                  ["--picture", str(part.parent / "no" / "p.svg")]):  # fmt: skip
        assert run(["post", *QUICK, *words, str(part)]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
    assert part.read_text() == LAYERS and len(list(part.parent.iterdir())) == 1


def test_programs_read_where_the_views_are(part: Path, views: list[Path], capsys) -> None:
    """In `written`, as of `plan`; a file that was planned already has none, which is said."""
    assert run(["post", *QUICK, "--json", "--report", str(part)]) == 0
    written = json.loads(capsys.readouterr().out)["written"]
    assert written == [str(part), str(views[0])]
    assert run(["post", *QUICK, "--report", str(part)]) == 0
    assert "so there is nothing to show" in capsys.readouterr().out
    assert len(views) == 1


def test_what_somebody_else_wrote_beside_the_file_stays(
    part: Path, views: list[Path], capsys
) -> None:
    """The name was not asked for by anybody; a report of ours is replaced."""
    report, picture = part.with_name("part.report.html"), part.with_name("part.picture.png")
    report.write_text("precious")
    picture.write_bytes(b"\x89PNG Software decmcts")
    assert run(["post", *QUICK, "--report", "--picture", str(part)]) == 0
    assert report.read_text() == "precious" and views == [picture]
    assert f"{report} is left as it is" in capsys.readouterr().err
