"""`decmcts replan`: from a plan that was broken off to files of the heads that live."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from agents.messages.event_stream import stream_of
from decmcts.cli.run import run
from decmcts.formats.plans.plan_json import read_plan, write_plan
from tests.makers.one_by_one import one_by_one
from tests.planning.replanning.conftest import (
    Made,
    cut,  # noqa: F401
    log_until,
    made,  # noqa: F401
    within_print,
)


@pytest.fixture
def plan(made: Made, tmp_path: Path) -> Path:  # noqa: F811
    path = tmp_path / "plan.json"
    write_plan(made.document, path)
    return path


@pytest.mark.slow
def test_from_events_to_files(
    made: Made, plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]  # noqa: F811
) -> None:  # fmt: skip
    """What the dead head alone reaches is said; plan and file of the rest pass the judge."""
    time_s, _ = within_print(made.document, 1, 12.0)
    log = log_until(made.document, time_s, failed=1)
    (tmp_path / "events.msgpack").write_bytes(stream_of(log))
    stem, rest = tmp_path / "rest", tmp_path / "rest.json"
    line = [
        "replan", str(plan), "--source", str(made.path), "--events",
        str(tmp_path / "events.msgpack"), "-o", str(stem), "--plan", str(rest),
        "--time-limit", "0.2", "--json",
    ]  # fmt: skip
    assert run(line) == 0
    said = json.loads(capsys.readouterr().out)
    count = said["replanned"]
    document = read_plan(rest)
    assert count["heads"] == ["left"] == [head.head for head in document.plan.heads]
    assert count["contours"] == count["printed"] + count["left_out"] + len(document.contours)
    assert count["left_out"] > 0
    assert any("contours are not finished" in note for note in said["notes"])
    assert any("broke off within contour" in note for note in said["notes"])
    assert sorted(tmp_path.glob("rest_*.gcode")) == [tmp_path / "rest_left.gcode"]
    assert run(["verify", str(rest)]) == 0
    whole = ["verify", str(tmp_path / "rest_left.gcode"), "--plan", str(rest)]
    assert run([*whole, "--source", str(tmp_path / "rest.gcode")]) == 0


@pytest.mark.slow
def test_a_rest_is_replanned_from_its_files(
    made: Made, plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]  # noqa: F811
) -> None:  # fmt: skip
    """Broken off twice: the second time from what the first replan wrote."""
    rest = tmp_path / "rest.json"
    line = ["replan", str(plan), "--source", str(made.path), "--layer", "2", "-o"]
    line += [str(tmp_path / "rest"), "--plan", str(rest), "--time-limit", "0.2"]
    assert run(line) == 0
    line = ["replan", str(rest), "--source", str(tmp_path / "rest.gcode"), "--height", "0.8"]
    line += ["--fenced", "right=park", "-o", str(tmp_path / "end"), "--time-limit", "0.2", "--json"]
    capsys.readouterr()
    assert run(line) == 0
    said = json.loads(capsys.readouterr().out)["replanned"]
    assert said["heads"] == ["left"] and said["printed"] > 0
    assert (tmp_path / "end_left.gcode").exists() and (tmp_path / "end.gcode").exists()


@pytest.mark.slow
def test_heads_that_stand_elsewhere_get_files_to_their_parks(
    made: Made, plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]  # noqa: F811
) -> None:  # fmt: skip
    """They are named in the order to run them, before the files of the rest; not once parked."""
    events = tmp_path / "events.msgpack"
    events.write_bytes(stream_of(log_until(made.document, 30.0)))
    line = ["replan", str(plan), "--source", str(made.path), "--events", str(events), "-o"]
    line += [str(tmp_path / "rest"), "--time-limit", "0.2", "--json"]
    assert run(line) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["replanned"]["to_park"] == ["left", "right"]
    names = ["rest-1_left_to_park.gcode", "rest-2_right_to_park.gcode"]
    assert [Path(name).name for name in said["written"][:2]] == names
    assert all(path.read_text().count("G1 Z") == 2 for path in (tmp_path / name for name in names))
    assert any(", ".join(f"STEM{name[4:]}" for name in names) in note for note in said["notes"])
    assert run([*line, "--parked"]) == 2  # whoever runs what is there would run those files too
    assert "earlier replan" in capsys.readouterr().err.splitlines()[-1]
    line[line.index("-o") + 1] = str(tmp_path / "again")
    assert run([*line, "--parked"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["replanned"]["to_park"] == [] and not list(tmp_path.glob("again*_to_park.gcode"))
    assert not any("to_park" in note for note in said["notes"])


@pytest.mark.slow
def test_a_head_that_cannot_park_is_named_and_nothing_written(
    made: Made, plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]  # noqa: F811
) -> None:  # fmt: skip
    """Somewhere in its bead it is too near to the one that is fenced; people can park it."""
    left = made.document.plan.heads[0]
    wall = next(k for k in range(9, len(left)) if abs(left.action_path(k)[:, 0].max() - 70.0) < 0.1)
    time_s = float(left.begin_s[wall] + left.end_s[wall]) / 2.0
    events = tmp_path / "events.msgpack"
    events.write_bytes(stream_of(log_until(made.document, time_s)))
    line = ["replan", str(plan), "--source", str(made.path), "--events", str(events), "-o"]
    line += [str(tmp_path / "rest"), "--time-limit", "0.2", "--fenced", "right=139.8,100,0.6"]
    assert run(line) == 2
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert "head left has no clear path to its park" in said and "--parked" in said
    assert not list(tmp_path.glob("rest*"))
    assert run([*line, "--parked"]) == 0


@pytest.mark.parametrize(
    ("more", "what"),
    [
        ([], "what is printed is not known"),
        (["--layer", "2", "--events", "x"], "several states of the print"),
        (["--height", "0.1"], "the lowest bead of the plan ends at 0.2 mm"),
        (["--height", "nan"], "the lowest bead of the plan ends at 0.2 mm"),
        (["--layer", "99"], "the plan has layers 1 to"),
        (["--layer", "2", "--fenced", "right"], "no event says where"),
        (["--layer", "2", "--fenced", "x=park"], "no head 'x'"),
        (["--events", "none"], "none"),
        (["--layer", "2", "--parked"], "no events are given"),
        (["--layer", "2", "--slower", "x=2"], "no head 'x'"),
        (["--layer", "2", "--slower", "left"], "'' is no factor"),
        (["--layer", "2", "--slower", "left=0.5"], "'0.5' is no factor"),
        (["--layer", "2", "--slower", "left=nan"], "'nan' is no factor"),
        (
            ["--layer", "2", "--slower", "left=2", "--fenced", "left=park"],
            "left: the head is fenced, and prints no more",
        ),
    ],
)
def test_bad_input_gets_one_line(
    made: Made, plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str],  # noqa: F811
    more: list[str], what: str,
) -> None:  # fmt: skip
    """And nothing is written."""
    stem = tmp_path / "rest"
    line = ["replan", str(plan), "--source", str(made.path), "-o", str(stem), *more]
    assert run(line) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert what in said[-1] and len(said) == 1
    assert not list(tmp_path.glob("rest*"))


@pytest.mark.slow
def test_a_rest_is_cut_as_the_plan_was(cut: Made, tmp_path: Path) -> None:  # noqa: F811
    """And its files pass the judge."""
    plan, rest, stem = (tmp_path / name for name in ("plan.json", "rest.json", "rest"))
    write_plan(cut.document, plan)
    line = ["replan", str(plan), "--source", str(cut.path), "--layer", "2", "--time-limit", "0.2"]
    assert run([*line, "--plan", str(rest), "-o", str(stem)]) == 0
    again = read_plan(rest)
    assert again.contours.of is not None and again.rules is not None and again.rules.cut == "all"
    files = [str(tmp_path / f"rest_{head}.gcode") for head in ("left", "right")]
    judged = ["verify", *files, "--plan", str(rest), "--source", str(tmp_path / "rest.gcode")]
    assert run(judged) == 0


@pytest.mark.slow
@pytest.mark.usefixtures("agents_here")
def test_the_rest_of_a_print_that_was_made_safe_is_planned(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The plan's contours are those of the source, layer by layer."""
    source, plan, stem = tmp_path / "in.gcode", tmp_path / "plan.json", tmp_path / "rest"
    source.write_text(one_by_one(2, (), layers=20, pitch_mm=14.0))
    line = ["launch", str(source), "--time-limit", "0.2", "--plan", str(plan)]
    assert run(line) == 0
    assert "it is printed layer by layer instead" in capsys.readouterr().err
    named = ["replan", str(plan), "--source", str(source), "--time-limit", "0.2"]
    named += ["--height", "2", "-o", str(stem), "--plan", f"{stem}.json"]
    assert run(named) == 0
    assert len(read_plan(f"{stem}.json").contours) == 2 * 2 * 10
    files = [f"{stem}_left.gcode", f"{stem}_right.gcode"]
    checked = ["--plan", f"{stem}.json", "--source", f"{stem}.gcode"]
    assert run(["verify", *files, *checked]) == 0
