"""What public functions return: short at a prompt, and its figures where one looks for them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import decmcts
from decmcts.formats.bare.qcsp import QcspSchedule
from decmcts.team.qcsp.solver import QcspResult
from tests.makers.agents import Agents, planned_here
from tests.prints import four_parts

MOST = 800  # characters, eight lines


@pytest.fixture(scope="module")
def source() -> decmcts.Source:
    return decmcts.read(decmcts.sample_path("four_nuts.gcode.gz"), "mk4s")


@pytest.fixture(scope="module")
def result(source) -> decmcts.Result:
    return decmcts.plan(source, decmcts.Search(0.0, planner="greedy"))


@pytest.fixture(scope="module")
def team(tmp_path_factory: pytest.TempPathFactory) -> decmcts.Result:
    source = decmcts.read(four_parts(tmp_path_factory.mktemp("team")), "dual-gantry")
    with planned_here(Agents()):
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


@pytest.mark.slow
@pytest.mark.parametrize("which", ["result", "team"])
def test_order_assignments_and_schedule_are_those_of_the_plan(which: str, request) -> None:
    """A program that draws or carries a plan out begins with these."""
    found = request.getfixturevalue(which)
    n = len(found.document.contours)
    assert found.order.shape == found.assignments.shape == (n,)
    assert found.schedule.shape == (n, 2)
    begin_s, end_s = found.schedule.T
    assert (np.diff(begin_s[found.order]) >= 0.0).all()
    assert (begin_s < end_s).all() and end_s.max() <= found.document.plan.makespan_s
    for k, head in enumerate(found.document.plan.heads):
        mine = found.order[found.assignments[found.order] == k]
        assert mine.tolist() == [c for c in head.contour.tolist() if c >= 0]
        assert np.array_equal(end_s[mine], head.end_s[head.contour >= 0])


@pytest.mark.slow
def test_a_simulated_print_has_events(result, tmp_path: Path) -> None:
    """They are of public types, in the order of their times."""
    result.write_plan(tmp_path / "plan.json")
    events = decmcts.simulate([tmp_path / "plan.json"]).events
    assert all(isinstance(event, decmcts.PrintEvent) for event in events)
    began = [event.action for event in events if event.kind == decmcts.EventKind.BEGAN]
    assert began == list(range(len(result.document.plan.heads[0])))
    assert all(a.time_s <= b.time_s for a, b in pairwise(events))


def test_cranes_have_an_order_and_assignments() -> None:
    """As heads have."""
    schedule = QcspSchedule(np.array([1, 0], np.int32), np.array([3.0, 0.0]), (), 5.0)
    found = QcspResult(schedule, 5.0, 1, np.zeros((0, 3)), 0)
    assert found.order.tolist() == [1, 0] and found.assignments.tolist() == [1, 0]
