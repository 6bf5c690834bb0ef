"""What stands beside a result never costs it."""

from __future__ import annotations

from pathlib import Path

import pytest

from decmcts.cli.run import run
from decmcts.errors import InputError
from decmcts.planning.result import Result
from tests.planning.problem.test_first_check import LAYERS


@pytest.mark.parametrize("view", ["report", "picture"])
def test_a_view_that_cannot_be_written_is_told_of_and_all_else_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys, view: str
) -> None:
    """On a full disk, say. Summary and plan.json are there, and the run has not failed."""

    def full(result: Result, path: Path, **_layer: int | None) -> None:
        raise InputError("cannot be written (No space left on device)", path=path)

    monkeypatch.setattr(Result, f"write_{view}", full)
    source, out, plan = (tmp_path / name for name in ("in.gcode", "out.gcode", "plan.json"))
    source.write_text(LAYERS)
    views = {"report": tmp_path / "view.html", "picture": tmp_path / "view.png"}
    words = ["--machine", "paper", "--planner", "greedy", "--allow-slower", "--plan", str(plan)]
    words += ["-o", str(out), f"--{view}", str(views[view])]
    assert run(["plan", str(source), *words]) == 0
    said = capsys.readouterr()
    assert f"{views[view].name}: cannot be written (No space" in said.err.replace("\n", "")
    assert out.exists() and plan.exists() and f"wrote {out}" in said.out.replace("\n", "")
    assert str(views[view]) not in said.out


@pytest.mark.parametrize("command", ["plan", "launch"])
def test_a_layer_the_print_has_not_is_refused_before_the_search(
    tmp_path: Path, capsys, command: str
) -> None:
    """In one line that says which there are, and nothing is written."""
    source = tmp_path / "in.gcode"
    source.write_text(LAYERS)
    words = ["--machine", "paper"] if command == "plan" else []
    words += ["--picture", str(tmp_path / "p.svg"), "--picture-layer", "99"]
    assert run([command, str(source), *words]) == 2
    said = capsys.readouterr().err
    assert "there is no layer 99 to draw" in said and "searching" not in said
    assert [path.name for path in tmp_path.iterdir()] == ["in.gcode"]
