"""Whatever is typed or goes wrong inside: one line, a code, no traceback."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from decmcts.cli.commands import launch, machines, plan, post, verify
from decmcts.cli.run import run
from tests.cli.test_bad_input import SQUARE, gcode

WRONG = [
    "plan", "plan no.gcode", "plan folder", "plan empty.gcode", "plan text.gcode",
    "plan a.gcode", "plan a.gcode --machine no.toml", "plan a.gcode --machine folder",
    "plan a.gcode --time-limit nan", "plan a.gcode --time-limit inf", "plan a.gcode --seed 1.5",
    "plan a.gcode --planner tabu",
    "plan a.gcode -o", "plan a.gcode -o a.gcode", "plan a.gcode -o no/x", "plan a.gcode -o folder",
    "plan a.gcode -o /dev/null", "plan a.gcode -o - --json", "plan a.gcode --plan -",
    "plan a.gcode -o p.json --plan p.json", "plan - --machine paper", "plan a.gcode b.gcode",
    "plan half.stl --machine mk4s --slicer no", "plan empty.sop", "plan text.sop",
    "plan text.sop --no-quality",
    "post", "post no.gcode", "post half.stl", "post - --machine paper", "post folder",
    "verify", "verify no.json", "verify bad.json", "verify deep.json", "verify a.gcode",
    "verify a.gcode --source half.stl", "verify a.gcode --source a.gcode --trials 0",
    "machines --draw no", "machines --machine no", "machines more", "machines --draw one.png",
    "machines --machine=", f"verify a.gcode --source a.gcode --trials {10**9}",
    f"plan a.gcode --machine mk4s --max-layers-ahead {2**31}",
    f"verify bad.json --max-layers-ahead {2**31}",
    "launch", "launch no.gcode", "launch a.gcode -o .", "launch a.gcode -o -",
    "launch a.gcode --planner mcts", "demo --out a.gcode", "demo --time-limit x", "plann", "--no",
]  # fmt: skip


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with one good file and several bad ones, which is the working directory."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "a.gcode").write_text(gcode(SQUARE))
    (tmp_path / "half.stl").write_bytes(bytes(80) + struct.pack("<I", 9) + bytes(30))
    for name in ("empty.gcode", "empty.sop"):
        (tmp_path / name).write_text("")
    for name in ("text.gcode", "text.sop", "bad.json"):
        (tmp_path / name).write_text("{ some text\n")
    (tmp_path / "deep.json").write_text("[" * 100_000)
    return tmp_path


@pytest.mark.parametrize("line", WRONG)
def test_what_cannot_be_done_is_said_in_one_line(line: str, place: Path, capsys) -> None:
    """People read the last line, scripts the code; nothing is written or changed."""
    before = sorted(place.iterdir())
    assert run(line.split()) == 2
    said = capsys.readouterr()
    assert said.out == ""
    last = said.err.splitlines()[-1]
    assert last.startswith("decmcts: ") and "Errno" not in last and "Error" not in last
    assert "Traceback" not in said.err and "nothing will be written" not in said.err
    assert sorted(place.iterdir()) == before
    assert (place / "a.gcode").read_text() == gcode(SQUARE)


@pytest.mark.parametrize(
    ("line", "module", "name"),
    [
        ("plan a.gcode --machine paper", plan, "run_single"),
        ("post a.gcode --machine paper", post, "run_single"),
        ("launch a.gcode", launch, "run_team"),
        ("verify a.gcode", verify, "judge"),
        ("machines", machines, "preset_names"),
    ],
)
@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (KeyError("\x1b[31mx\ny"), 70, "internal error: KeyError"),
        (MemoryError(), 70, "out of memory"),
        (OSError(28, "No space left on device", "part.gcode"), 2, "part.gcode: No space left"),
        (RecursionError("deep"), 70, "internal error: RecursionError"),
    ],
)
def test_a_fault_of_ours_is_one_line(
    line, module, name, error, code, words, place, monkeypatch, capsys
) -> None:
    """A traceback helps nobody who did not ask for it, and a file's bytes command no terminal."""

    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.delenv("DECMCTS_DEBUG", raising=False)
    monkeypatch.setattr(module, name, fail)
    assert run(line.split()) == code
    last = capsys.readouterr().err.splitlines()[-1]
    assert words in last
    assert "Traceback" not in last and "\x1b" not in last
    assert (place / "a.gcode").read_text() == gcode(SQUARE)
