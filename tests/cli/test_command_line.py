"""The command line itself: one line for each mistake, and standard output for results only."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest
from rich.table import Table

from agents.launching.status import AgentStatus
from decmcts.cli.console import out, steps
from decmcts.cli.run import run
from decmcts.errors import InputError
from decmcts.formats.machines.machine_file import preset_names
from decmcts.planning.events import Heads, Note, Progress, Step
from decmcts.planning.writing.places import refuse_unwritable
from tests.cli.test_bad_input import SQUARE, gcode
from tests.formats.gcode.dialects.test_layers import PRUSA, towers


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["plan"], "Missing argument"),
        (["plann"], "plann"),
        (["plan", "x", "--seed", "-1"], "--seed"),
        (["plan", "x", "--planner", "tabu"], "tabu"),
        (["plan", "a.gcode", "--min-layer-time", "inf"], "--min-layer-time"),
        (["plan", "a.gcode", "--picture-layer", "3"], "add --picture"),
        (["launch", "a.gcode", "--picture-layer", "3"], "add --picture"),
        (["launch", "a.gcode", "--weld-limit-s", "-1"], "'--weld-limit-s'"),
        (["launch", "a.gcode", "--weld-limit-s", "nan"], "'--weld-limit-s'"),
        (["launch", "a.gcode", "--weld-limit-s", "inf"], "'--weld-limit-s'"),
        (["launch", "a.gcode", "--weld-limit-s", "9", "--cut", "none"], "--weld-limit-s 9"),
        (["launch", "a.gcode", "--stagger-mm", "-1"], "'--stagger-mm'"),
        (["launch", "a.gcode", "--stagger-mm", "nan"], "'--stagger-mm'"),
        (["launch", "a.gcode", "--stagger-mm", "5.1"], "'--stagger-mm'"),
        (["launch", "a.gcode", "--stagger-mm", "2", "--cut", "none"], "--stagger-mm 2"),
    ],
)
def test_a_wrong_command_line_is_one_line(arguments, word, capsys):
    """Scripts read the last line; a box drawn around it is no line."""
    assert run(arguments) == 2
    said = capsys.readouterr()
    assert len(said.err.splitlines()) == 1
    assert word in said.err
    assert said.out == ""


@pytest.mark.parametrize("command", ["verify", "simulate", "run"])
def test_a_seed_says_what_it_is_of(command, capsys):
    """What replays and simulates does not search: its seed draws errors of time."""
    assert run([command, "--help"]) == 0
    said = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "Equal seeds give equal errors" in said


def test_no_arguments_show_help(capsys):
    """Whoever types the bare name wants to know what it can do."""
    assert run([]) == 2
    assert "launch" in capsys.readouterr().out


def test_json_is_all_there_is_on_standard_output(tmp_path, capsys):
    """Programs parse standard output as it is; the steps go to the person beside them."""
    source = tmp_path / "part.gcode"
    source.write_text(gcode(SQUARE))
    assert run(["plan", str(source), "--machine", "paper", "--time-limit", "0.1", "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["verified"] is True
    assert "searching" in said.err


def test_time_as_the_objective_is_named_and_never_worse(tmp_path, capsys):
    """The summary says what was minimised, and the bound is on that."""
    source, made = tmp_path / "part.gcode", tmp_path / "out.gcode"
    source.write_text(gcode("M204 P700\nM203 X55\n" + SQUARE))
    words = ["plan", str(source), "--machine", "paper", "--time-limit", "0.1", "--json"]
    assert run([*words, "--objective", "time", "-o", str(made), "--allow-slower"]) == 0
    said = json.loads(capsys.readouterr().out)
    before, after = said["before"], said["after"]
    assert after["objective"] == "time"
    assert after["makespan_s"] <= before["makespan_s"]
    assert after["bound_s"] == pytest.approx(after["travel_s"])  # so few are solved exactly
    assert "bound_mm" not in after
    assert said["file_time_s"]["before"] > 0.0 and said["file_time_s"]["after"] > 0.0
    assert " for time," in made.read_text()
    assert run([*words, "--limits", "machine"]) == 0
    fast = json.loads(capsys.readouterr().out)
    assert fast["before"]["makespan_s"] < before["makespan_s"]  # M203 X55 is left out


def test_steps_are_lines_where_nobody_watches(capsys):
    """A log file wants the steps, no blank lines and no spinner."""
    with steps() as report:
        report(Step("reading [/a].gcode"))
    assert capsys.readouterr().err == "reading [/a].gcode\n"


def test_steps_say_how_far_they_are_and_are_left_out_of_a_short_log(capsys):
    """After the search too; a slicer's log wants notes and the result only."""
    with steps() as report:
        report(Step("writing out.gcode", 1, 3))
    assert capsys.readouterr().err == "writing out.gcode (1 of 3)\n"
    with steps(logged=False) as report:
        report(Step("writing out.gcode", 1, 3))
        report(Progress(6.0, 1, 90.0, 0.0))
        report(Note("no machine is named"))
    assert capsys.readouterr().err == "no machine is named\n"


def test_heads_that_search_are_lines_where_nobody_watches(capsys):
    """Half a minute of silence looks like a hang."""
    with steps(time_limit_s=30.0, table=lambda _: Table()) as report:
        for at_s, best_s in (
            (0.4, math.inf),
            (6.0, 4402.2),
            (7.0, 4400.0),
            (11.0, 4305.0),
            (31.0, 4305.0),
        ):
            heads = (AgentStatus(0, "left", elapsed_s=at_s, best_makespan_s=best_s),)
            report(Heads(heads, 4100.0))
        report(Heads((), 0.0))
    assert capsys.readouterr().err.splitlines() == [
        "heads search, 6 of 30 s: print time 1:13:22, 7 % above the bound",
        "heads search, 11 of 30 s: print time 1:11:45, 5 % above the bound",
        "heads search, 31 s: print time 1:11:45, 5 % above the bound",
    ]


def test_names_with_brackets_are_printed_as_they_are(capsys):
    """Brackets are no markup here; a name must not be eaten or crash a finished run."""
    out.print("wrote part[1][/x] :smile:.gcode", soft_wrap=True)
    assert capsys.readouterr().out == "wrote part[1][/x] :smile:.gcode\n"


def test_interrupted_command_says_so(capsys):
    """Code 130 without a word leaves the user guessing what was written."""
    assert run(["machines"], program=lambda **_: 130) == 130
    assert "stopped" in capsys.readouterr().err


@pytest.mark.slow
def test_interrupt_while_starting_is_one_line():
    """The libraries load for a second; Ctrl-C then must not print a traceback."""
    code = (
        "import sys, os, signal, decmcts.cli as cli\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # CI may ignore it
        "class Stop:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'decmcts.cli.run': os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Stop())\n"
        "cli.main()\n"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ended.returncode == 130
    assert len(ended.stderr.splitlines()) == 1


def test_outputs_of_one_name_are_refused(tmp_path: Path):
    """The second would silently replace the first."""
    one = tmp_path / "out.html"
    with pytest.raises(InputError, match="two outputs"):
        refuse_unwritable([one, None, tmp_path / "." / "out.html"], tmp_path / "in.gcode")


def test_a_pipe_is_no_output(tmp_path: Path):
    """Known before the search, not after it."""
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="device or pipe"):
        refuse_unwritable([tmp_path / "pipe"], tmp_path / "in.gcode")


@pytest.mark.parametrize("option", ["--plan", "--report", "--picture"])
def test_an_output_of_another_kind_is_refused(option, tmp_path, capsys):
    """A PNG called .jpg, or a plan that `verify` takes for G-code, helps nobody."""
    source = tmp_path / "part.gcode"
    source.write_text(gcode(SQUARE))
    assert run(["plan", str(source), option, str(tmp_path / "out.gcode")]) == 2
    assert "must end in" in capsys.readouterr().err


def test_file_of_one_head_is_not_judged_alone(tmp_path, capsys):
    """Thousands of missing beads would be reported; the joint plan is what can be checked."""
    source, half = tmp_path / "part.gcode", tmp_path / "part_left.gcode"
    source.write_text(gcode(SQUARE))
    half.write_text("; made\n; head left, file 1 of 2: to be run together\n" + gcode(SQUARE))
    assert run(["verify", str(half), "--source", str(source)]) == 2
    said = capsys.readouterr().err
    assert "head left, file 1 of 2" in said
    assert "plan.json" in said


def test_one_head_of_several_is_named(tmp_path, capsys):
    """`plan` on a machine with two heads uses one; which one must be said."""
    source = tmp_path / "part.gcode"
    source.write_text(gcode(SQUARE))
    assert run(["plan", str(source), "--machine", "dual-gantry", "--time-limit", "0.1"]) == 0
    said = capsys.readouterr().err
    assert "left alone" in said
    assert "decmcts launch" in said


def test_the_file_of_a_head_may_not_be_the_input(tmp_path, capsys):
    """`-o part` writes part_left.gcode; when that is the input, it must survive."""
    source = tmp_path / "part_left.gcode"
    source.write_text(gcode(SQUARE))
    assert run(["launch", str(source), "-o", str(tmp_path / "part"), "--time-limit", "0.1"]) == 2
    assert "the output is the input" in capsys.readouterr().err
    assert source.read_text() == gcode(SQUARE)


def test_a_bare_folder_is_no_stem(tmp_path, capsys):
    """`-o .` has no name to put heads' names behind."""
    source = tmp_path / "part.gcode"
    source.write_text(gcode(SQUARE))
    assert run(["launch", str(source), "-o", "."]) == 2
    assert "folder" in capsys.readouterr().err


def test_machines_are_readable_in_a_narrow_terminal(monkeypatch, capsys):
    """A column squeezed to seven letters is ten lines a machine and still cut off."""
    monkeypatch.setattr(out, "width", 80, raising=False)
    assert run(["machines"]) == 0
    said = capsys.readouterr().out
    assert "slices of Prusa's own gantry model" in " ".join(said.split())
    assert len(said.splitlines()) < 3 * len(preset_names())


def test_a_seam_without_its_freedom_is_refused(tmp_path, capsys):
    """A policy that would be ignored is a misunderstanding."""
    source = tmp_path / "part.gcode"
    source.write_text(gcode(SQUARE))
    assert run(["plan", str(source), "--machine", "paper", "--seam", "rear"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1 and "--freedom seam" in said[0]
    assert run(["post", str(source), "--machine", "paper", "--seam", "rear"]) == 2


@pytest.mark.parametrize("seam", [[], ["--seam", "rear"], ["--seam", "corner"]])
def test_loops_begin_where_the_seam_policy_says(tmp_path, capsys, seam):
    """The file written is judged against its source again, and the summary says what was done."""
    source, out = tmp_path / "part.gcode", tmp_path / "out.gcode"
    source.write_text(gcode(SQUARE + SQUARE.replace("X1", "X2").replace("Y120", "Y110")))
    asked = ["--machine", "paper", "--freedom", "seam", *seam, "--time-limit", "0.1", "--json"]
    asked.append("--allow-slower")  # what a seam saves here is less than a lift takes
    assert run(["plan", str(source), "-o", str(out), *asked]) == 0
    after = json.loads(capsys.readouterr().out)["after"]
    assert after["seam"] == (seam[1] if seam else "nearest")
    assert 0.0 <= after["bound_mm"] <= after["extrusionless_travel_mm"]
    text = out.read_text()
    assert f"freedom seam ({after['seam']})" in text
    first = next(x for x in text.splitlines() if x.startswith("G1 X1") and "E" not in x)
    assert ("Y120" in first) == bool(seam)
    assert run(["verify", str(out), "--source", str(source), "--machine", "paper"]) == 0


@pytest.mark.parametrize("command", ["plan", "post", "launch", "verify", "machines", "demo"])
def test_help_fits_a_terminal_of_80_columns(command, monkeypatch, capsys):
    """Names cut off cannot be typed; options in panels can be found."""
    monkeypatch.setenv("COLUMNS", "80")
    assert run([command, "--help"]) == 0
    said = capsys.readouterr().out
    assert "…" not in said
    assert max(len(line.rstrip()) for line in said.splitlines()) <= 80
    options = said.split("Options ", 1)[1].split("╰", 1)[0]
    assert [line for line in options.splitlines() if "--" in line] == [
        line for line in options.splitlines() if "--help" in line
    ]


def test_layers_entered_more_often_are_said_once(tmp_path, capsys):
    """A viewer's layer slider turns into one of the sequence; who looks must know why."""
    source, made = tmp_path / "part.gcode", tmp_path / "out.gcode"
    source.write_text(towers(*PRUSA))
    words = ["--machine", "paper", "--time-limit", "0.1", "--allow-slower", "-o", str(made)]
    assert run(["plan", str(source), *words]) == 0
    line = "layers are entered 6 times instead of 3"
    assert capsys.readouterr().out.count(line) == 1
    assert made.read_text().count("; " + line) == 1
    assert made.read_text().count(";LAYER_CHANGE\n") == 6
    assert run(["verify", str(made), "--source", str(source), "--machine", "paper"]) == 0


def test_post_is_named_where_it_could_edit_the_input(tmp_path: Path, capsys):
    """Whoever names the input as output wants it edited in place."""
    source = tmp_path / "part.gcode"
    source.write_text(gcode(SQUARE))
    assert run(["plan", str(source), "-o", str(source)]) == 2
    assert "use `decmcts post` to edit in place" in capsys.readouterr().err
    assert run(["launch", str(source), "--plan", str(source)]) == 2
    assert "decmcts post" not in capsys.readouterr().err


def test_a_picture_of_machines_needs_to_know_which(tmp_path: Path, capsys):
    """It said that there is no such folder, and to make it."""
    assert run(["machines", "--draw", str(tmp_path / "all.png")]) == 2
    assert "a picture is of one machine; add --machine NAME" in capsys.readouterr().err
