"""`decmcts launch`: what it is told and what it says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from decmcts.cli.commands.replay import COLUMNS, read_record
from decmcts.cli.run import run
from decmcts.experiments.made_print import made_gcode
from decmcts.formats.plans.plan_json import read_plan
from decmcts.print.plan import ActionKind
from decmcts.samples import sample_path
from sim.verify import verify_plan
from tests.makers.two_tools import made_tools_gcode
from tests.prints import four_parts

TEAM = ["--machine", "dual-gantry"]


@pytest.mark.slow
@pytest.mark.usefixtures("agents_here")
def test_launch_says_that_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before the search and after it, as `plan` does."""
    line = ["launch", str(four_parts(tmp_path)), *TEAM, "--time-limit", "0.1"]
    assert run(line) == 0
    said = " ".join(capsys.readouterr().err.split())
    assert "nothing will be written" in said and "nothing was written; `-o STEM`" in said
    assert run([*line, "--json"]) == 0
    assert "nothing w" not in capsys.readouterr().err


@pytest.mark.slow
def test_a_file_of_parameters_changes_what_agents_do(tmp_path: Path) -> None:
    """Without a tree a head has one plan to tell, so it is never undecided."""
    chosen, record, plan = tmp_path / "team.toml", tmp_path / "r.jsonl", tmp_path / "plan.json"
    chosen.write_text("share = 0 # no tree\nwindows = 0\ntries = 1\n")
    line = ["launch", str(sample_path("four_nuts.gcode.gz")), "--team", str(chosen)]
    line += ["--time-limit", "0.2", "--record", str(record), "--plan", str(plan)]
    assert run(line) == 0
    rounds, entropy = COLUMNS.index("rounds"), COLUMNS.index("entropy")
    told = [row for _, rows in read_record(record)[1] for row in rows if row[rounds] != "0"]
    assert told and {row[entropy] for row in told} == {"0.00"}
    stated = read_plan(plan).metrics["parameters"]
    assert stated == {"share": 0, "windows": 0, "tries": 1}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("gama = 0.9", "team.toml: gama: unknown key; known here: gamma, exploration"),
        ("alpha = 1.5", "team.toml: alpha: expected a number in 0..1, found 1.5"),
        ("windows = 2.5", "team.toml: windows: expected a whole number in 0..1000, found 2.5"),
        ("beta = 'hot'", "team.toml: beta: expected a number in 0.001..100, found 'hot'"),
        ("gamma = 0.9\nbeta = = 1", "team.toml:2: Invalid value; see docs/team.md"),
        ("gamma = \xff", "team.toml:1: "),
        (None, "team.toml: cannot be read"),
    ],
)
def test_a_file_of_parameters_that_cannot_be_used_is_one_line(
    text: str | None, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2 before anything is read or written."""
    chosen, source = tmp_path / "team.toml", tmp_path / "plate.gcode"
    source.write_text("")
    if text is not None:
        chosen.write_text(text, encoding="utf-8")
    before = sorted(tmp_path.iterdir())
    line = ["launch", str(source), "-o", str(tmp_path / "out"), "--team", str(chosen)]
    assert run([*line, "--record", str(tmp_path / "r.jsonl")]) == 2
    heard = capsys.readouterr().err.strip().splitlines()
    assert len(heard) == 1 and said in heard[0]
    assert sorted(tmp_path.iterdir()) == before


def test_the_file_of_parameters_is_not_written_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A slip of the name must not cost a user's file."""
    chosen, source = tmp_path / "team.toml", tmp_path / "plate.gcode"
    chosen.write_text("alpha = 0.0")
    source.write_text("")
    assert run(["launch", str(source), "--team", str(chosen), "--record", str(chosen)]) == 2
    assert "team.toml: the output is read too" in capsys.readouterr().err
    assert chosen.read_text() == "alpha = 0.0"


@pytest.mark.slow
@pytest.mark.parametrize("freedom", ["fixed", "seam"])
def test_heads_are_as_free_as_was_asked(
    tmp_path: Path, freedom: str, request: pytest.FixtureRequest
) -> None:
    """Nothing is reversed with `fixed`; with `seam` loops are entered elsewhere; all is sound."""
    if freedom == "fixed":  # one of them with real agents
        request.getfixturevalue("agents_here")
    plan, source = tmp_path / "plan.json", tmp_path / "in.gcode"
    source.write_text(made_gcode([(60, 100), (240, 100)], layers=2))
    options = [
        *TEAM,
        "--cut",
        "none",
        "--freedom",
        freedom,
        "--time-limit",
        "0.5",
        "--plan",
        str(plan),
    ]
    assert run(["launch", str(source), "--freedom", freedom, *options]) == 0
    document = read_plan(plan)
    assert document.metrics["planner"] == "dec-mcts"
    assert document.rules is not None and document.rules.freedom == freedom
    turned = any(bool(head.reversed.any()) for head in document.plan.heads)
    moved = any(bool(head.entry.any()) for head in document.plan.heads)
    assert (turned, moved) == ((False, False) if freedom == "fixed" else (True, True))
    assert not verify_plan(document).faults


def test_a_seam_needs_its_freedom(capsys: pytest.CaptureFixture[str]) -> None:
    """In one line, before anything is read."""
    source = str(sample_path("four_nuts.gcode.gz"))
    assert run(["launch", source, "--seam", "rear"]) == 2
    assert "seam rear needs freedom seam" in " ".join(capsys.readouterr().err.split())


@pytest.mark.slow
def test_the_tool_of_each_head_is_stated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A preset prints two tools on two heads; without a word it is refused, and says what to do."""
    plan, source = tmp_path / "plan.json", tmp_path / "in.gcode"
    source.write_text(made_tools_gcode(macro=False))
    line = ["launch", str(source), *TEAM, "--time-limit", "0.2", "--plan", str(plan)]
    assert run([*line, "-o", str(tmp_path / "out")]) == 2
    assert "--tool left=0 …, or `tools` in the machine file" in capsys.readouterr().err
    assert run([*line, "--tool", "left=1", "--tool", "right=0"]) == 0
    document = read_plan(plan)
    assert [head.tools for head in document.machine.heads] == [(1,), (0,)]
    for head, tool in zip(document.plan.heads, (1, 0), strict=True):
        printed = head.contour[head.kind == ActionKind.PRINT]
        assert np.unique(document.contours.tool[printed]).tolist() == [tool]
    assert not verify_plan(document).faults


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        (["middle=0"], "--tool middle=0: the machine has no head 'middle'; its heads are left, ri"),
        (["left"], "--tool left: '' is no tool; give its number in the source, 0 to 254"),
        (["left=255"], "--tool left=255: '255' is no tool"),
        (["left=-1"], "--tool left=-1: '-1' is no tool"),
        (["left=²"], "is no tool"),
        (["left=0", "left=1"], "--tool left=1: head left has tool 0 already"),
    ],
)
def test_what_is_no_tool_of_a_head_is_refused(
    stated: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In one line, before anything is read."""
    line = ["launch", str(tmp_path / "in.gcode"), *TEAM]
    assert run([*line, *(word for one in stated for word in ("--tool", one))]) == 2
    assert said in capsys.readouterr().err
