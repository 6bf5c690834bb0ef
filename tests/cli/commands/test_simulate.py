"""`decmcts simulate`: what it writes, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

from decmcts.cli.run import run
from decmcts.formats.plans.plan_json import write_plan
from tests.planning.replanning.conftest import Made, made  # noqa: F401


@pytest.mark.slow
def test_a_report_of_a_run(made: Made, tmp_path: Path) -> None:  # noqa: F811
    """Of a plan; files of heads have no actions to show."""
    plan, report = tmp_path / "plan.json", tmp_path / "run.html"
    write_plan(made.document, plan)
    assert run(["simulate", str(plan), "--report", str(report)]) == 0
    assert report.stat().st_size > 100_000
    assert run(["simulate", str(made.path), "--report", str(tmp_path / "no.html")]) == 2
    assert not (tmp_path / "no.html").exists()
