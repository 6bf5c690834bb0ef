"""What public functions return: short at a prompt, and its figures where one looks for them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from pathlib import Path

import numpy as np
import pytest

import decmcts

MOST = 800  # characters, eight lines


@pytest.fixture(scope="module")
def source() -> decmcts.Source:
    return decmcts.read(decmcts.sample_path("four_nuts.gcode.gz"), "mk4s")


@pytest.fixture(scope="module")
def result(source) -> decmcts.Result:
    return decmcts.plan(source, decmcts.Search(0.0, planner="greedy"))


@pytest.fixture(scope="module")
def team() -> decmcts.Result:
    source = decmcts.read(decmcts.sample_path("plate.gcode.gz"), "dual-gantry")
    return decmcts.launch(source, decmcts.TeamSearch(time_limit_s=0.5))


def found_in(thing: object, seen: dict[type, object]) -> Iterator[object]:
    """Yield one object of each of our types that can be reached by public names."""
    if isinstance(thing, Mapping | tuple | list):
        for one in list(thing.values() if isinstance(thing, Mapping) else thing)[:5]:
            yield from found_in(one, seen)
    elif is_dataclass(type(thing)) and type(thing) not in seen:
        seen[type(thing)] = thing
        yield thing
        for name in dir(thing):
            if not name.startswith("_"):
                yield from found_in(getattr(thing, name), seen)


@pytest.mark.slow
def test_whatever_a_person_meets_is_shown_in_a_few_lines(result, team, tmp_path: Path) -> None:
    """A result of 4000 numbers a contour buries the prompt."""
    written = result.write_gcode(tmp_path / "out.gcode")
    result.write_plan(tmp_path / "plan.json")
    (tmp_path / "one.qcsp").write_text(
        '{"t":1,"s":1,"p":[4,3],"l":[2,6],"r":[0],"l0":[1],"Phi":[]}'
    )
    problem = decmcts.read_qcsp(tmp_path / "one.qcsp")
    things = [
        written, team, result.source, decmcts.load_machine("dual-gantry"), problem,
        decmcts.solve_qcsp(problem, max_iterations=10),
        decmcts.solve_sop(np.ones((50, 50)), np.array([[0, 1]]), time_limit_s=0.1),
        decmcts.simulate([tmp_path / "plan.json"]),
        decmcts.verify(tmp_path / "plan.json"),
    ]  # fmt: skip
    seen: dict[type, object] = {}
    long = {type(one).__name__: len(repr(one)) for thing in things for one in found_in(thing, seen)}
    assert {"Result", "Source", "PlanDocument", "Machine", "Simulated", "Contours"} <= set(long)
    assert not {name: length for name, length in long.items() if length > MOST}


@pytest.mark.slow
def test_a_result_says_what_it_is_of_and_its_main_figures(result) -> None:
    """That is what a person at a prompt asks first."""
    shown = repr(result)
    assert "four_nuts" in shown and "mk4s" in shown
    assert f"travel_mm={result.after.travel_mm:.0f}"[:14] in shown
