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

    def full(result: Result, path: Path) -> None:
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
