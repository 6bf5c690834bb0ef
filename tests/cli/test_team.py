"""The command line around the agents: whatever happens to them, the print gets a plan."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NoReturn

import pytest

from agents.supervisor import LaunchError
from decmcts.cli import team
from decmcts.cli.app import run
from decmcts.formats.plan_json import read_plan
from examples import example_path
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
    source = str(example_path("four_nuts.gcode.gz"))
    assert run(["launch", source, "--time-limit", "0.5", "--plan", str(plan)]) == 0
    assert "one head prints alone" in capsys.readouterr().err
    document = read_plan(plan)
    assert sorted(len(head) > 0 for head in document.plan.heads) == [False, True]
    assert not verify_plan(document).faults
