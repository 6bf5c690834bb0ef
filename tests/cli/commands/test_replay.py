"""What a launch's agents did can be shown again; what is no recording is one line."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

from agents.launching.status import AgentStatus
from decmcts.cli.commands import replay
from decmcts.cli.commands.replay import heads_table, read_record, recording
from decmcts.cli.options import app
from decmcts.errors import InputError
from decmcts.planning.events import Heads

LEFT = AgentStatus(0, "left", "planning", (0, 1), 3, 120.0, 1.5, {"Distribution": 2}, entropy=0.4)


def test_a_recording_comes_back(tmp_path: Path) -> None:
    """Every state that was shown, with the bound."""
    path = tmp_path / "launch.jsonl"
    with recording(path) as keep:
        keep(Heads((LEFT,), 100.0))
        keep(Heads((LEFT, LEFT), 100.0))
    bound_s, states = read_record(path)
    assert bound_s == 100.0 and [len(rows) for _, rows in states] == [1, 2]
    row = ["left", "planning", "2", "3", "0:02:00", "1.200", "0.40", "2", "0", "0", "0"]
    assert states[0][1] == [row]


def test_replay_shows_the_last_state(tmp_path: Path) -> None:
    """What is left on the terminal is how it ended."""
    path = tmp_path / "launch.jsonl"
    with recording(path) as keep:
        keep(Heads((LEFT,), 100.0))
    shown = CliRunner().invoke(app, ["replay", str(path), "--speed", "100"])
    assert shown.exit_code == 0 and "left" in shown.output and "1.200" in shown.output


def test_the_table_fits_a_plain_terminal() -> None:
    """Of 80 columns: nothing is cut off, whatever large figures a long search has."""
    long = AgentStatus(
        0, "right-back", "planning", (0, 1), 1280, 119_289.3, 3600.0, {"Joint": 1331},
        sent_bytes={"Joint": 9_305_014}, received={"Joint": 2331},
        received_bytes={"Joint": 19_305_014}, entropy=0.4,
    )  # fmt: skip
    console = Console(width=80, record=True, file=StringIO())
    console.print(heads_table(Heads((long,), 100_000.0)))
    shown = console.export_text()
    assert "…" not in shown
    for word in ("right-back", "planning", "3600", "33:08:09", "1.193", "heard", "18,853"):
        assert word in shown


@pytest.mark.parametrize("text", ["", "{}", "[]", "nonsense", '{"format": "other/1"}', "[" * 9000])
def test_what_is_no_recording_is_refused(tmp_path: Path, text: str) -> None:
    """In one line, whatever it is."""
    path = tmp_path / "other.txt"
    path.write_text(text)
    with pytest.raises(InputError):
        read_record(path)


@pytest.mark.parametrize("cut", [40, 60, 100, -2])
def test_a_recording_that_was_cut_off_is_damaged(tmp_path: Path, cut: int) -> None:
    """Wherever it was; it was called none where it was cut near its beginning."""
    path = tmp_path / "launch.jsonl"
    with recording(path) as keep:
        keep(Heads((LEFT,), 100.0))
        keep(Heads((LEFT, LEFT), 100.0))
    whole = path.read_text()
    path.write_text(whole[:cut])
    line = whole[:cut].count("\n") + 1
    with pytest.raises(InputError, match=f"launch.jsonl:{line}: this recording is damaged"):
        read_record(path)


@pytest.mark.parametrize(
    ("said", "instead"),
    [
        ('"0.40", ', ""),
        ('"0.40"', "0.40"),
        ('"0.40"', "null"),
        ('"at_s": ', '"at_s": Infinity, "was": '),
        ('"heads": [', '"heads": [3, '),
        ('"at_s": ', '"at_s": 1e300, "was": '),
        ('"at_s": ', '"at_s": 1e9, "was": '),
        ('"at_s": ', '"at_s": NaN, "was": '),
        ('"at_s": ', '"at_s": -1, "was": '),
        ('"at_s": ', '"at_s": "1", "was": '),
        ('"planning"', '["x"]'),
        ('"left"', '"' + "left" * 100 + '"'),
        ('"heads"', '"head"'),
    ],
)
def test_a_recording_whose_figures_are_none_is_damaged(
    tmp_path: Path, said: str, instead: str
) -> None:
    """It ended in an internal error when it was shown."""
    path = tmp_path / "launch.jsonl"
    with recording(path) as keep:
        keep(Heads((LEFT,), 100.0))
    whole = path.read_text()
    assert said in whole
    path.write_text(whole.replace(said, instead))
    with pytest.raises(InputError, match=r"launch\.jsonl:2: this recording is damaged"):
        read_record(path)


def test_times_of_a_recording_do_not_fall(tmp_path: Path) -> None:
    """Nothing that a launch writes does."""
    path = tmp_path / "launch.jsonl"
    with recording(path) as keep:
        keep(Heads((LEFT,), 100.0))
    head, state = path.read_text().splitlines()
    late, early = (re.sub(r'"at_s": [0-9.]+', f'"at_s": {at}', state) for at in (5, 4))
    path.write_text("\n".join([head, late, early, ""]))
    with pytest.raises(InputError, match=r"launch\.jsonl:3: this recording is damaged"):
        read_record(path)


def test_no_state_is_waited_for_longer_than_a_while(tmp_path, monkeypatch) -> None:
    """A launch that was stopped for a day in between is shown in seconds."""
    path, slept = tmp_path / "launch.jsonl", list[float]()
    with recording(path) as keep:
        keep(Heads((LEFT,), 100.0))
    head, state = path.read_text().splitlines()
    at = [re.sub(r'"at_s": [0-9.]+', f'"at_s": {s}', state) for s in (0, 2, 86402, 86404)]
    path.write_text("\n".join([head, *at, ""]))
    monkeypatch.setattr(replay.time, "sleep", slept.append)
    monkeypatch.setattr(replay.time, "monotonic", lambda: 0.0)
    assert CliRunner().invoke(app, ["replay", str(path), "--speed", "1"]).exit_code == 0
    assert slept == [0.0, 2.0, 12.0, 14.0]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a full disk is a device of Linux'")
def test_a_full_disk_costs_the_recording_and_nothing_else(capsys) -> None:
    """It cost the launch, and named no file."""
    with recording(Path("/dev/full")) as keep:
        for _ in range(3):
            keep(Heads((LEFT,), 100.0))
    said = capsys.readouterr().err
    assert (
        said.replace("\n", " ").count("/dev/full: the recording cannot be written (No space") == 1
    )


def test_no_share_of_the_bound_where_there_is_no_plan_yet() -> None:
    """The column said `inf`."""
    searching = replace(LEFT, best_makespan_s=math.inf)
    console = Console(width=80, record=True, file=StringIO())
    console.print(heads_table(Heads((searching,), 100.0)))
    assert "inf" not in console.export_text()
