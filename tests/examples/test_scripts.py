"""The examples for programs: each runs, and shows what it says."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType
from typing import cast

import pytest

from decmcts.formats.gcode import read_gcode
from decmcts.samples import sample_path
from examples import measure_head

FOLDER = Path(measure_head.__file__).parent
NAMES = sorted(path.stem for path in FOLDER.glob("0*.py"))


def script(number: int) -> ModuleType:
    return importlib.import_module(f"examples.{NAMES[number - 1]}")


def test_every_example_is_listed() -> None:
    """Whoever opens the folder reads README.md first."""
    listed = (FOLDER / "README.md").read_text()
    assert len(NAMES) == 7
    assert all(f"{name}.py" in listed for name in [*NAMES])
    assert "tour.ipynb" in listed


@pytest.mark.slow
def test_one_head(tmp_path: Path) -> None:
    """A file comes out that is as long as the source, and quicker to print."""
    nuts, out = sample_path("four_nuts.gcode.gz"), tmp_path / "better.gcode"
    written = script(1).main(str(nuts), str(out), time_limit_s=0.3)
    assert written.paths == (out,)
    assert len(read_gcode(out)[0].contours) == len(read_gcode(nuts)[0].contours)
    assert written.times.after_s <= written.times.before_s


@pytest.mark.slow
def test_your_own_machine() -> None:
    """More room around a head is room it cannot print in."""
    found = script(2).main(iterations=100_000)
    assert found["as measured"] < found["5 mm more room"]


@pytest.mark.slow
def test_prove_how_near(capsys: pytest.CaptureFixture[str]) -> None:
    """The bound is below the travel, the file is sound, and a spoiled one is not."""
    proven, verdict = script(3).main(time_limit_s=0.5)
    assert proven.bound is not None and proven.bound <= proven.travel
    assert verdict.ok
    assert "left out: missing contour" in capsys.readouterr().out


@pytest.mark.slow
def test_two_heads(tmp_path: Path) -> None:
    """Both heads have a file, and together they are quicker than one."""
    written = script(4).main(tmp_path, time_limit_s=0.5)
    assert [path.name for path in written.paths] == ["plate_left.gcode", "plate_right.gcode"]
    assert all(path.exists() for path in [*written.paths, tmp_path / "plate.png"])
    result = written.result
    assert result.bound_s < result.after.print_time_s < 0.7 * result.before.print_time_s


@pytest.mark.slow
def test_your_own_planner() -> None:
    """It finds something; what is worth more is found by ours."""
    found = cast("dict[str, float]", script(5).main(time_limit_s=0.5))
    assert found["hybrid"] < found["walks"] < found["as sliced"]


@pytest.mark.slow
def test_your_own_team_planner() -> None:
    """What it finds is a plan that passed the judge, and gains much of what two heads can."""
    result = script(6).main(time_limit_s=0.5)
    assert result.verdict.ok and result.document.metrics["planner"] == "borders"
    assert result.after.print_time_s < 0.7 * result.before.print_time_s
    assert set(result.assignments.tolist()) == {0, 1}


@pytest.mark.slow
def test_from_arrays(tmp_path: Path) -> None:
    """A print that no slicer made is planned, written and judged as any other."""
    result, verdict = script(7).main(tmp_path / "towers.gcode", time_limit_s=0.3)
    assert verdict.ok and len(result.order) == 90
    assert result.after.travel_mm < 0.7 * result.before.travel_mm
