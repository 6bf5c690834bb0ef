"""Names that are paths or commands, damaged files, and what is no file: one line, exit code 2."""

from __future__ import annotations

import ast
import io
import json
import os
import socket
import tomllib
from pathlib import Path

import pytest

from decmcts.cli.run import run
from decmcts.cli.terminal import SafeConsole, harmless
from decmcts.errors import InputError
from decmcts.formats.files.atomic import write_whole
from decmcts.formats.files.names import as_file_name
from decmcts.planning.writing.places import refuse_place
from tests.cli.test_bad_input import SQUARE, gcode, refused

ROOT = Path(__file__).parents[2]
PRESET = (ROOT / "decmcts" / "machines" / "mk4s.toml").read_text()


def renamed(folder: Path, name: str) -> Path:
    """Write a preset under another name; returns its file."""
    own = f'name = "{tomllib.loads(PRESET)["name"]}"'
    assert own in PRESET
    path = folder / "own.toml"
    path.write_text(PRESET.replace(own, f"name = {json.dumps(name)}"))
    return path


@pytest.mark.slow
@pytest.mark.parametrize("name", ["../escaped", "/tmp/escaped", "..", "a/../../b", "C:\\x"])
def test_the_name_of_a_machine_is_no_path(tmp_path: Path, name: str) -> None:
    """A drawing of a machine file that somebody else wrote landed outside of its folder."""
    drawn = tmp_path / "in" / "drawn"
    drawn.mkdir(parents=True)
    assert run(["machines", "--machine", str(renamed(tmp_path, name)), "--draw", str(drawn)]) == 0
    assert [path.name for path in drawn.iterdir()] == [f"{as_file_name(name)}.png"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in", "own.toml"]


@pytest.mark.parametrize("name", ["a\nM104 S300", "a\x1b[2J", " a", "x" * 201])
def test_the_name_of_a_machine_is_one_line(tmp_path: Path, name: str, capsys) -> None:
    """It stands in a comment of each file that is made for the machine."""
    said = refused(["machines", "--machine", str(renamed(tmp_path, name))], capsys)
    assert "own.toml" in said and "is no name" in said and "\x1b" not in said


@pytest.mark.parametrize("terminal", [True, False])
def test_nothing_that_is_shown_commands_a_terminal(terminal: bool) -> None:
    """Macros, names and recordings hold what others wrote: lines, tables, and what changes."""
    from rich.live import Live
    from rich.progress import Progress
    from rich.table import Table

    hostile = "a\x1b]0;title\x07b\x9b2J\u202ec\udc9bd\x08"
    shown = io.StringIO()
    console = SafeConsole(file=shown, force_terminal=terminal, markup=False)
    table = Table(title=hostile)
    table.add_column(hostile)
    table.add_row(hostile)
    console.print(hostile, soft_wrap=True)
    console.print(table)
    with Progress(console=console) as progress:
        progress.add_task(hostile, total=1)
    with Live(table, console=console):
        pass
    text = shown.getvalue()
    assert "title" in text
    assert not {"\x1b]", "\x07", "\x9b", "\u202e", "\udc9b"} & {
        *text, *(text[k : k + 2] for k in range(len(text)))
    }  # fmt: skip
    assert harmless("fine → µ\n") == "fine → µ\n"


def test_there_is_one_way_to_the_terminal() -> None:
    """A console of its own, or a bare print, would show what files hold as it is."""
    named = {"terminal.py", "console.py"}
    for path in sorted((ROOT / "decmcts").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                made = node.func.id
                assert made not in ("Console", "SafeConsole") or path.name in named, path
                assert made != "print" or path.name == "warm.py", path  # parts, to its parent


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no such files there")
@pytest.mark.parametrize("kind", ["pipe", "socket", "device", "folder"])
@pytest.mark.parametrize(
    "command",
    [
        ["plan", "part.gcode"], ["plan", "part.stl", "--machine", "mk4s"], ["plan", "part.sop"],
        ["launch", "part.qcsp"], ["launch", "part.gcode"], ["post", "part.gcode"],
        ["verify", "plan.json"], ["verify", "part.gcode", "--source", "part.gcode"],
        ["replay", "part.rec"], ["machines", "--machine", "own.toml"],
        ["machines", "--machine", "own.json"], ["machines", "--machine", "own.ini"],
        ["plan", "whole.gcode", "--machine", "own.toml"], ["launch", "whole.gcode", "--team",
        "team.toml"],
    ],
    ids=lambda command: "-".join(command[:2]),
)  # fmt: skip
def test_what_is_no_file_is_refused_at_once(
    tmp_path: Path, kind: str, command: list[str], monkeypatch, capsys
) -> None:
    """A device never ends, and a pipe waits for somebody to write."""
    monkeypatch.chdir(tmp_path)
    Path("whole.gcode").write_text(gcode(SQUARE))
    held = []
    for name in {word for word in command if "." in word} - {"whole.gcode"}:
        if kind == "pipe":
            os.mkfifo(name)
        elif kind == "socket":
            held.append(socket.socket(socket.AF_UNIX))
            held[-1].bind(name)
        elif kind == "folder":
            Path(name).mkdir()
        else:
            Path(name).symlink_to("/dev/zero")
    try:
        said = refused(command, capsys)
    finally:
        for each in held:
            each.close()
    if kind != "folder":
        assert "is a device, pipe or socket" in said or "device or pipe" in said


def test_a_name_that_is_too_long_is_found_before_the_work(tmp_path: Path) -> None:
    """`post` planned for a minute and could not make its draft then."""
    with pytest.raises(InputError, match="at most 255 are possible"):
        refuse_place(tmp_path / ("x" * 300))
    longest = tmp_path / ("\U0001f600" * 62 + ".gcode")
    refuse_place(longest)
    write_whole(longest, b"G28\n")
    assert longest.read_bytes() == b"G28\n"


@pytest.mark.parametrize("command", ["plan", "launch"])
@pytest.mark.parametrize("name", ["x" * 300 + ".gcode", "no/such/folder.gcode"])
def test_outputs_are_asked_for_before_the_work(
    tmp_path: Path, command: str, name: str, capsys
) -> None:
    """Nobody wants to learn it after the search."""
    source = tmp_path / "part.gcode"
    source.write_text(gcode(SQUARE))
    said = refused([command, str(source), "-o", str(tmp_path / name)], capsys)
    assert "bytes" in said or "too long" in said or "no such folder" in said
