"""`decmcts replan`: from a plan that was broken off to files of the heads that live."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from agents.messages.event_stream import stream_of
from decmcts.cli.run import run
from decmcts.formats.plans.plan_json import read_plan, write_plan
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
        (["--layer", "2", "--slower", "x=2"], "no head 'x'"),
        (["--layer", "2", "--slower", "left"], "'' is no factor"),
        (["--layer", "2", "--slower", "left=0.5"], "'0.5' is no factor"),
        (["--layer", "2", "--slower", "left=nan"], "'nan' is no factor"),
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
def test_a_rest_is_cut_as_asked(cut: Made, tmp_path: Path) -> None:  # noqa: F811
    """As the plan was, or not at all; the judge holds it against that plan."""
    plan, rest, stem = (tmp_path / name for name in ("plan.json", "rest.json", "rest"))
    write_plan(cut.document, plan)
    line = ["replan", str(plan), "--source", str(cut.path), "--layer", "2", "--time-limit", "0.2"]
    assert run([*line, "--cut", "none", "--plan", str(rest)]) == 0
    uncut = read_plan(rest)
    assert uncut.contours.of is None and uncut.rules is not None and uncut.rules.cut == "none"
    assert run([*line, "--plan", str(rest), "-o", str(stem)]) == 0
    again = read_plan(rest)
    assert again.contours.of is not None and again.rules is not None and again.rules.cut == "all"
    files = [str(tmp_path / f"rest_{head}.gcode") for head in ("left", "right")]
    judged = ["verify", *files, "--plan", str(rest), "--source", str(tmp_path / "rest.gcode")]
    assert run([*judged, "--rest-of", str(plan)]) == 0
