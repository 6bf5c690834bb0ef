"""The line for a slicer runs as it stands, from any folder and through any shell."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from decmcts.cli.commands.post import completed, own_program, script_line, wherever_it_runs
from decmcts.cli.run import run

HARD = ["/my tools/it's $HOME;`x`/decmcts", "post", "--machine", 'a "b" c.toml']


@pytest.mark.skipif(os.name == "nt", reason="its shell is another")
def test_a_shell_takes_the_line_apart_as_meant(tmp_path: Path) -> None:
    """PrusaSlicer gives it to $SHELL -c, with the file in single quotes behind it."""
    program = tmp_path / "it's mine" / "decmcts"
    program.parent.mkdir()
    program.write_text('#!/bin/sh\nfor word in "$@"; do echo "<$word>"; done\n')
    program.chmod(0o700)
    line = script_line([str(program), *HARD[1:]], ["--report"], windows=False)
    said = subprocess.run(
        ["sh", "-c", f"{line} '/tmp/a b.gcode'"], capture_output=True, text=True, check=True
    )
    words = [*HARD[1:], "--report", "/tmp/a b.gcode"]
    assert said.stdout.splitlines() == [f"<{word}>" for word in words]


def test_windows_takes_the_line_apart_as_meant() -> None:
    """Its rule: quotes around blanks; a backslash counts only before a quote."""
    line = script_line([r"C:\Program Files\x\decmcts.exe"], ["post", "--machine", "mk4s"],
                       windows=True)  # fmt: skip
    assert line == r'"C:\Program Files\x\decmcts.exe" post --machine mk4s'
    assert script_line(["C:\\x\\decmcts.exe"], ["a\\"], windows=True) == "C:\\x\\decmcts.exe a\\"


def test_the_program_is_found_by_its_whole_path(tmp_path: Path, monkeypatch) -> None:
    """A slicer has another search path than the terminal it was tried in."""
    script = tmp_path / "bin" / ("decmcts.exe" if os.name == "nt" else "decmcts")
    script.parent.mkdir()
    script.write_text("")
    script.chmod(0o700)
    monkeypatch.setattr(sys, "executable", str(script.parent / "python"))
    assert own_program() == [str(script)]
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    monkeypatch.setattr(sys, "argv", [str(script), "post"])
    assert own_program() == [str(script)]
    monkeypatch.setattr(sys, "argv", ["-m", "post"])
    assert own_program() == [str(tmp_path / "python"), "-P", "-m", "decmcts.cli"]


def test_files_are_named_in_full(tmp_path: Path, monkeypatch) -> None:
    """The slicer runs the line in a folder of its own; presets and values stay as they are."""
    monkeypatch.chdir(tmp_path)
    Path("own.toml").write_text("")
    own, view = str(tmp_path / "own.toml"), str(tmp_path / "v.html")
    assert wherever_it_runs(["--machine", "own.toml", "--seed", "3"]) == [
        "--machine", own, "--seed", "3"
    ]  # fmt: skip
    assert wherever_it_runs(["--machine=own.toml", "--report=v.html"]) == [
        f"--machine={own}", f"--report={view}"
    ]  # fmt: skip
    assert wherever_it_runs(["--machine", "mk4s", "--report", "--picture"]) == [
        "--machine", "mk4s", "--report", "--picture"
    ]  # fmt: skip


def test_the_line_is_all_there_is_on_standard_output(capsys) -> None:
    """With the options given, as they were given; where to paste it is said beside."""
    assert run(["post", "--show-line", "--machine", "mk4s", "--report", "--seed", "2"]) == 0
    said = capsys.readouterr()
    words = shlex.split(said.out) if os.name != "nt" else said.out.split()
    assert words[-6:] == ["post", "--machine", "mk4s", "--report", "--seed", "2"]
    assert Path(words[0]).is_absolute()
    assert "Post-processing scripts" in said.err


def test_a_file_with_the_line_is_refused(capsys) -> None:
    """The slicer appends it: it would be given twice."""
    assert run(["post", "--show-line", "part.gcode"]) == 2
    assert "the slicer names the file itself" in capsys.readouterr().err
    assert run(["post"]) == 2
    assert "--show-line" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("given", "made"),
    [
        ("--report part.gcode", "--report beside part.gcode"),
        ("part.gcode --report", "part.gcode --report beside"),
        ("--report a.html --picture b.SVG p.gcode", "--report a.html --picture b.SVG p.gcode"),
        ("--report=a.html --picture -v p", "--report=a.html --picture beside -v p"),
        ("--report a.png p", "--report beside a.png p"),
        ("-- --report p", "-- --report p"),
        ("--machine --report", "--machine --report beside"),
    ],
)
def test_what_follows_is_a_file_only_if_it_is_named_like_one(given: str, made: str) -> None:
    """A slicer puts the G-code behind the words: it must never be taken for the report."""
    assert completed(given.split()) == made.split()
