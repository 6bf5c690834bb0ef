"""Names that are paths or commands, damaged files, and what is no file: one line, exit code 2."""

from __future__ import annotations

import ast
import io
import json
import os
import re
import socket
import threading
import tomllib
from pathlib import Path

import pytest

from decmcts.cli.console import SafeConsole, harmless
from decmcts.cli.run import run
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


WAYS = re.compile(
    r"print|(Safe)?Console|typer\.(s?echo|secho)|traceback\.print_\w+|warnings\.warn"
    r"|sys\.(stdout|stderr)(\.buffer)?\.write|os\.write"
)
KNOWN = {  # what else leads to a terminal or to a pipe, and what is said there
    "decmcts/cli/console.py": {"SafeConsole", "sys.stdout.write"},  # JSON: controls as escapes
    "decmcts/cli/options.py": {"typer.echo"},  # our version
    "decmcts/cli/signals.py": {"os.write"},  # a line of ours
    "decmcts/cli/streams.py": {"sys.stderr.write"},  # the system's words
    "decmcts/cli/__init__.py": {"sys.stderr.write"},  # a line of ours
    "decmcts/planning/writing/places.py": {"sys.stdout.buffer.write"},  # G-code, by `-o -`
    "agents/loop/pipes.py": {"print", "os.write"},  # harmless, or a digest; JSON to its parent
    "agents/launching/processes.py": {"print"},  # harmless
    "agents/running/port.py": {"os.write"},  # msgpack to the other end of a pipe
    "agents/networks/zenoh_session.py": {"os.write"},  # a password, to a file in memory
}


def ways_of(path: Path) -> set[str]:
    """Return what a module calls that may show something."""
    calls = (n for n in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(n, ast.Call))
    return {name for call in calls if WAYS.fullmatch(name := ast.unparse(call.func))}


def test_there_is_one_way_to_the_terminal() -> None:
    """A console of its own, or a bare print, would show what files hold as it is."""
    found = {}
    for package in ("decmcts", "agents", "sim"):
        for path in sorted((ROOT / package).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            if ways := ways_of(path):
                found[name] = ways
    assert found == KNOWN


def test_a_traceback_commands_no_terminal(tmp_path: Path, monkeypatch, capsys) -> None:
    """With --debug, and where a thread fails: what a file holds stands in both."""
    monkeypatch.setenv("DECMCTS_DEBUG", "1")

    def fail(**_: object) -> int:
        thread = threading.Thread(target=fail_too)
        thread.start()
        thread.join()
        raise InputError("bad name \x1b]0;owned\x07", path=tmp_path / "a\x1b[2J")

    def fail_too() -> None:
        raise ValueError("in a thread \x1b[31m")

    monkeypatch.setattr(threading, "excepthook", threading.excepthook)
    assert run(["plan"], program=fail) == 2
    said = capsys.readouterr().err
    assert said.count("Traceback") == 2 and "in a thread" in said and "owned" in said
    assert "\x1b" not in said and "\x07" not in said


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


def test_a_name_that_the_locale_cannot_write_is_found_before_the_work(tmp_path: Path) -> None:
    """`launch` for a head with an umlaut was an internal error where names are ASCII."""
    with pytest.raises(InputError, match=r"no letter '\\ud800' for names of files"):
        refuse_place(tmp_path / "out_\ud800.gcode")


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
