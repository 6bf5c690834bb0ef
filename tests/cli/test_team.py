"""The command line around the agents: whatever happens to them, the print gets a plan."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest

from agents.supervisor import LaunchError
from decmcts.cli import team
from decmcts.cli.app import run
from decmcts.cli.record import read_record
from decmcts.formats.machine_file import load_machine
from decmcts.formats.plan_json import read_plan
from decmcts.print.seam import seam_entries
from decmcts.samples import sample_path
from sim.verify import verify_plan


@pytest.mark.slow
def test_agents_that_come_to_no_plan_leave_one_head(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Down to the single-extruder mode there is always a valid plan, and it is said."""

    def no_plan(*_: Any, **__: Any) -> NoReturn:
        raise LaunchError("every agent ended")

    monkeypatch.setattr(team, "launch_agents", no_plan)
    plan = tmp_path / "plan.json"
    source = str(sample_path("four_nuts.gcode.gz"))
    assert run(["launch", source, "--time-limit", "0.5", "--plan", str(plan)]) == 0
    assert "one head prints alone" in capsys.readouterr().err
    document = read_plan(plan)
    assert sorted(len(head) > 0 for head in document.plan.heads) == [False, True]
    assert not verify_plan(document).faults


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """No agents are started: one head prints alone."""

    def no_plan(*_: Any, **__: Any) -> NoReturn:
        raise LaunchError("no agents here")

    monkeypatch.setattr(team, "launch_agents", no_plan)


@pytest.mark.slow
@pytest.mark.usefixtures("alone")
def test_launch_says_that_nothing_is_written(capsys: pytest.CaptureFixture[str]) -> None:
    """Before the search and after it, as `plan` does."""
    line = ["launch", str(sample_path("four_nuts.gcode.gz")), "--time-limit", "0.5"]
    assert run(line) == 0
    said = " ".join(capsys.readouterr().err.split())
    assert "nothing will be written" in said and "nothing was written; `-o STEM`" in said
    assert run([*line, "--json"]) == 0
    assert "nothing w" not in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.usefixtures("alone")
def test_launch_says_that_a_purge_line_is_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """On the terminal and among the notes; of a plan alone nothing is left out."""
    source = tmp_path / "in.gcode"
    with gzip.open(sample_path("four_nuts.gcode.gz"), "rt") as file:
        source.write_text("G28\nM83\nG1 X0 Y0 Z.3\nG1 X60 E9 F1000\n" + file.read())
    line = ["launch", str(source), "--time-limit", "0.5"]
    assert run([*line, "-o", str(tmp_path / "part")]) == 0
    assert "extrudes 9.0 mm of filament on the bed" in " ".join(capsys.readouterr().err.split())
    assert run([*line, "-o", str(tmp_path / "part"), "--json"]) == 0
    notes = json.loads(capsys.readouterr().out)["notes"]
    assert any("prime each head" in note for note in notes)
    assert run([*line, "--json"]) == 0
    assert "prime each head" not in capsys.readouterr().out


@pytest.mark.slow
def test_a_file_of_parameters_changes_what_agents_do(tmp_path: Path) -> None:
    """Without a tree a head has one plan to tell, so it is never undecided."""
    chosen, record, plan = tmp_path / "team.toml", tmp_path / "r.jsonl", tmp_path / "plan.json"
    chosen.write_text("share = 0 # no tree\nwindows = 0\npolicies = 1\n")
    line = ["launch", str(sample_path("four_nuts.gcode.gz")), "--team", str(chosen)]
    line += ["--time-limit", "1", "--record", str(record), "--plan", str(plan)]
    assert run(line) == 0
    told = [agent for _, agents in read_record(record)[1] for agent in agents if agent.rounds]
    assert told and {agent.entropy for agent in told} == {0.0}
    stated = read_plan(plan).metrics["parameters"]
    assert stated == {"share": 0, "windows": 0, "policies": 1}


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
def test_heads_are_as_free_as_was_asked(tmp_path: Path, freedom: str) -> None:
    """Nothing turns with `fixed`; with `seam` loops are entered elsewhere and all stays sound."""
    plan, source = tmp_path / "plan.json", str(sample_path("plate.gcode.gz"))
    options = ["--freedom", freedom, "--time-limit", "2", "--plan", str(plan)]
    assert run(["launch", source, *options]) == 0
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
    assert "needs --freedom seam" in " ".join(capsys.readouterr().err.split())


def print_of_parts(folder: Path) -> str:
    """Four parts at two ends of the bed: three loops of each on each of four layers."""
    text = "; generated by PrusaSlicer 2.5.0\nM201 X300 Y300\nG28\nG90\nM83\n"
    for layer in range(1, 5):
        text += f";LAYER_CHANGE\n;Z:{0.2 * layer:.1f}\n;HEIGHT:0.2\n"
        for x, y in ((40, 60), (40, 200), (250, 60), (250, 200)):
            for side in (20, 14, 8):
                low, high = -side / 2, side / 2
                corners = [(low, low), (high, low), (high, high), (low, high), (low, low + 0.3)]
                (first_x, first_y), *rest = [(x + a, y + b) for a, b in corners]
                text += f";TYPE:External perimeter\n;WIDTH:0.45\nG1 X{first_x} Y{first_y} "
                text += f"Z{0.2 * layer:.1f} F9000\nG1 E1 F2400\nG1 F1800\n"
                text += "".join(f"G1 X{a} Y{b} E{side * 0.03}\n" for a, b in rest)
                text += "G1 E-1 F2400\n"
    path = folder / "parts.gcode"
    path.write_text(text + "M104 S0\nM84\n")
    return str(path)


def launched(folder: Path, *options: str) -> Any:
    """Launch the parts with these options, have the files verified, return the plan."""
    source = print_of_parts(folder)
    plan, stem = str(folder / "plan.json"), str(folder / "head")
    given = ["launch", source, "--time-limit", "0.5", "--plan", plan, "-o", stem, *options]
    assert run(given) == 0
    files = [str(path) for path in sorted(folder.glob("head_*.gcode"))]
    assert len(files) == 2
    assert run(["verify", *files, "--source", source, "--plan", plan]) == 0
    return read_plan(Path(plan))


@pytest.mark.slow
@pytest.mark.parametrize("objective", ["travel", "time"])
def test_loops_are_entered_where_travels_are_short(
    told: list[Any], tmp_path: Path, objective: str
) -> None:
    """The files of all heads hold such loops, and the judge passes them."""
    sliced = launched(tmp_path)
    found = launched(tmp_path, "--freedom", "seam", "--objective", objective)
    assert found.metrics["makespan_s"] < sliced.metrics["makespan_s"]
    assert found.metrics["extrusionless_travel_mm"] < sliced.metrics["extrusionless_travel_mm"]
    assert any((head.entry > 0).any() for head in found.plan.heads)
    said = [found.metrics[name] for name in ("planner", "freedom", "seam", "objective")]
    assert said == ["dec-mcts", "seam", "nearest", objective]
    assert found.rules is not None and found.rules.freedom == "seam"
    files = sorted(tmp_path.glob("head_*.gcode"))
    alone = ["--source", str(tmp_path / "parts.gcode"), "--machine", "dual-gantry"]
    assert run(["verify", *map(str, files), *alone]) == 0
    entered = next(head for head in found.plan.heads if (head.entry > 0).any())
    row = entered.action_path(int(np.flatnonzero(entered.entry > 0)[0]))[-1]
    spoiled = next(path for path in files if path.stem.endswith(entered.head))
    end, beside = (f"X{row[0] + by:.3f} Y{row[1] + by:.3f} E" for by in (0.0, 0.1))
    assert end in spoiled.read_text()
    other = spoiled.read_text().replace(end, beside, 1)
    spoiled.write_text(other)
    assert run(["verify", *map(str, files), *alone]) == 1


@pytest.mark.slow
@pytest.mark.parametrize("policy", ["aligned", "rear", "corner"])
def test_every_loop_begins_where_the_policy_says(
    told: list[Any], tmp_path: Path, policy: Any
) -> None:
    """Whichever head prints it, and whether that takes longer or not."""
    document = launched(tmp_path, "--freedom", "seam", "--seam", policy)
    entry = np.zeros(len(document.contours), np.int32)
    for head in document.plan.heads:
        printed = head.contour >= 0
        entry[head.contour[printed]] = head.entry[printed]
    assert entry.tolist() == seam_entries(document.contours, policy).vertices.tolist()


@pytest.mark.slow
def test_fixed_leaves_every_contour_as_sliced(told: list[Any], tmp_path: Path) -> None:
    """As for one head."""
    document = launched(tmp_path, "--freedom", "fixed")
    assert not any(head.reversed.any() or head.entry.any() for head in document.plan.heads)


@pytest.mark.slow
def test_limits_of_the_machine_go_before_the_source_s(told: list[Any], tmp_path: Path) -> None:
    """Every agent plans with them, and the bound is of them."""
    own = launched(tmp_path).metrics["bound"]["serial_s"]
    theirs = launched(tmp_path, "--limits", "machine").metrics["bound"]["serial_s"]
    (job, first), (_, second) = told
    limits = load_machine("dual-gantry").limits
    assert first.limits == limits.under(job.limits) != limits
    assert second.limits == limits
    assert own != theirs
