"""What a dead head's tool should print, another prints with its own where a person allows it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from decmcts.cli.run import run
from decmcts.errors import InputError
from decmcts.formats.plans.plan_json import read_plan
from decmcts.planning.events import unheard
from decmcts.planning.options import Cut, Limits, Rules, TeamSearch
from decmcts.planning.problem.made_from import rules_of
from decmcts.planning.problem.own_tools import team_problem
from decmcts.planning.problem.planned import document_of
from decmcts.planning.problem.source import Source, read
from decmcts.planning.replanning.fenced import (
    needed,
    other_tools,
    refuse_other_diameters,
    refuse_unfit,
)
from decmcts.planning.replanning.replan import Rest, replan, rest_of
from decmcts.planning.result import Result
from decmcts.print.plan import PlanDocument
from decmcts.print.print_state import state_of_layers
from decmcts.print.toolpath import Toolpath
from decmcts.team.schedule.joint_plan import schedule
from tests.planning.writing.test_own_tools import launched, two_bars
from tests.planning.writing.test_tools import HOT, machine_file, temperatures, two_tools

SEARCH = TeamSearch(0.2)
PARKS = {"left": (-45.0, 150.0, 10.0), "right": (345.0, 150.0, 10.0)}
FANS = (200, 50)  # of each tool, 0 to 255


class Made(NamedTuple):
    """A plan for a head a tool that could be carried out, and its source."""

    document: PlanDocument
    source: Source
    path: Path


def made_of(path: Path, folder: Path, tools: tuple[int, int] = (0, 1)) -> Made:
    """Plan a print of two tools by hand: each by its head, in the order it is sliced in."""
    source = read(
        path,
        machine_file(folder, *tools),
        limits=Limits.MACHINE,
        report=unheard,
    )
    problem = team_problem(source, Rules(), unheard)
    tool = problem.job.contours.tool
    paths = [
        Toolpath.of(rows.astype(np.int32), np.zeros(len(rows), np.bool_))
        for rows in (np.flatnonzero(tool == own) for own in tools)
    ]
    plan = schedule(problem.job, problem.machine, problem.graph, paths)
    return Made(document_of(problem, plan, {}), replace(source, machine=problem.machine), path)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    folder = tmp_path_factory.mktemp("tools")
    path = Path(two_tools(folder, relative=True))
    text = path.read_text()
    for tool, fan in enumerate(FANS):
        text = text.replace(f"M109 S{HOT[tool]}\nG1 E9", f"M109 S{HOT[tool]}\nM106 S{fan}\nG1 E9")
    path.write_text(text.replace("T0\nG1 X60", f"T0\nM106 S{FANS[0]}\nG1 X60", 1))
    return made_of(path, folder)


def rest_without(
    made: Made, head: str, print_with: dict[int, int] | None, layers: int = 1
) -> Rest:  # fmt: skip
    """Return what is left behind some layers for the heads but one, which is parked."""
    state = state_of_layers(made.document, layers)
    return rest_of(
        made.document, made.source, state, {head: PARKS[head]}, print_with=print_with
    )  # fmt: skip


def written(rest: Rest, made: Made, alone: Any, folder: Path) -> list[str]:
    """Plan a rest, write it; return the arguments that verify its files as left of the plan."""
    result: Result = replan(rest, SEARCH, rules_of(made.document), agents=alone)
    (path,) = result.write_gcode(folder / "rest").paths
    (folder / "rest.gcode").write_bytes(rest.source.path.read_bytes())
    result.write_plan(folder / "rest.json")
    return [str(path), "--plan", str(folder / "rest.json"), "--source", str(folder / "rest.gcode")]


@pytest.mark.slow
@pytest.mark.parametrize(("head", "due", "has"), [("left", 0, 1), ("right", 1, 0)])
def test_another_tool_prints_for_a_dead_heads(
    made: Made, alone: Any, tmp_path: Path, head: str, due: int, has: int
) -> None:
    """All of it, where and as much as it was sliced, as hot and cooled as that tool prints."""
    rest = rest_without(made, head, {due: has})
    contours, whole = rest.source.job.contours, made.document.contours
    left = np.flatnonzero(whole.layer > 0)
    assert not rest.left.rows.any() and len(contours) == len(left)
    assert (contours.tool == has).all()
    rows = np.repeat(np.arange(len(whole)), np.diff(whole.offsets))
    assert np.allclose(contours.points, whole.points[np.isin(rows, left)], atol=1e-3)
    assert np.allclose(contours.extrusion, whole.extrusion[np.isin(rows, left)], atol=1e-5)
    assert np.allclose(contours.feed, whole.feed[np.isin(rows, left)], atol=1e-3)
    words = f"4 contours of tool {due} are printed with tool {has}'s filament"
    assert rest.lines == [words]
    checked = written(rest, made, alone, tmp_path)
    text = Path(checked[0]).read_text()
    assert set(temperatures(Path(checked[0]))) == {HOT[has], 0}
    assert f"M106 S{FANS[due]}" not in text
    assert read_plan(tmp_path / "rest.json").print_with == ((due, has),)
    assert run(["verify", *checked]) == 0


@pytest.mark.slow
def test_a_rest_for_one_tool_has_its_heads_own_text(
    made: Made, alone: Any, tmp_path: Path
) -> None:  # fmt: skip
    """Its head was heated as another tool's, and pulled back for each tool the source changes."""
    rest = rest_without(made, "left", None)
    assert rest.left.rows.sum() == 4 and not rest.print_with
    checked = written(rest, made, alone, tmp_path)
    assert temperatures(Path(checked[0])) == [HOT[1], HOT[1], 0]
    assert "G1 E9.00000" in Path(checked[0]).read_text()
    assert "nothing is moved across" not in " ".join(rest.source.job.notes)
    assert run(["verify", *checked]) == 0


@pytest.mark.slow
def test_a_cut_print_of_several_tools_is_replanned(
    agents: Any, alone: Any, tmp_path: Path
) -> None:  # fmt: skip
    """It was taken for another print, as changes of tools are walls in its source."""
    source = Path(two_bars(tmp_path))
    result, _, _ = launched(str(source), tmp_path, agents, cut=Cut.ALL)
    found = read(
        source,
        result.document.machine,
        limits=Limits.MACHINE,
        report=unheard,
    )
    assert result.document.contours.of is not None
    made = Made(result.document, found, source)
    rest = rest_without(made, "left", {0: 1}, layers=2)
    assert not rest.left.rows.any()
    assert run(["verify", *written(rest, made, alone, tmp_path)]) == 0


def test_a_living_tool_prints_for_nobody(made: Made) -> None:
    """What is allowed counts once no living head has the tool, and another has the other."""
    machine = made.document.machine
    contours = made.document.contours
    for head, due in (("left", {0: 1}), ("right", {})):
        living = machine.of_heads([one for one in machine.heads if one.name != head])
        assert needed({0: 1}, living, contours) == due
    assert needed({0: 1}, machine, contours) == {}


@pytest.mark.parametrize(
    ("said", "what"),
    [
        (["0"], "it is no pair of tools"),
        (["0=x"], "it is no pair of tools"),
        (["0=0"], "it is one tool"),
        (["0=3"], "the print has no tool 3; its tools are 0, 1"),
        (["7=1"], "the print has no tool 7"),
        (["0=1", "1=0"], "tool 1 does not print itself"),
    ],
)
def test_bad_pairs_are_refused(made: Made, said: list[str], what: str) -> None:
    """In one line."""
    with pytest.raises(InputError, match=what):
        other_tools(said, made.document.machine, made.document.contours)


def test_pairs_of_prints_that_have_none_are_refused(made: Made) -> None:
    """Of one tool, or where heads have all tools."""
    contours = made.document.contours
    one = replace(contours, tool=np.zeros_like(contours.tool))
    with pytest.raises(InputError, match="the print has one tool, 0"):
        other_tools(["0=1"], made.document.machine, one)
    heads = tuple(replace(head, tools=()) for head in made.document.machine.heads)
    with pytest.raises(InputError, match="have not one tool each"):
        other_tools(["0=1"], replace(made.document.machine, heads=heads), contours)


def test_pairs_fit_who_lives(made: Made) -> None:
    """A tool whose head lives prints itself; one whose head is dead prints for nobody."""
    machine = made.document.machine
    with pytest.raises(InputError, match="head left has tool 0 and lives"):
        refuse_unfit({0: 1}, machine, [])
    with pytest.raises(InputError, match="no head that lives has tool 1"):
        refuse_unfit({0: 1}, machine, ["left", "right"])
    refuse_unfit({0: 1}, machine, ["left"])


def test_filament_of_another_diameter_is_refused(made: Made, tmp_path: Path) -> None:
    """E would be another amount; a nozzle or a kind of filament a person has seen."""
    other = tmp_path / "in.gcode"
    stated = "; filament_type = PLA;PETG\n; filament_diameter = "
    source = replace(made.source, path=other)
    other.write_text(made.path.read_text() + stated + "1.75,1.75\n")
    refuse_other_diameters(source, {0: 1})
    other.write_text(made.path.read_text() + stated + "1.75,2.85\n")
    with pytest.raises(InputError, match=r"filament of tool 0 is 1\.75 mm thick, of tool 1 2\.85"):
        refuse_other_diameters(source, {0: 1})
    refuse_other_diameters(made.source, {0: 1})


@pytest.mark.slow
def test_a_change_to_another_temperature_stays(made: Made, alone: Any, tmp_path: Path) -> None:
    """Slicers print the first layer hotter: what follows is as hot as that tool is then."""
    text = made.path.read_text().split(f"M109 S{HOT[1]}")
    hotter = tmp_path / "in.gcode"
    hotter.write_text(f"M109 S{HOT[1]}".join(text[:-1]) + f"M109 S{HOT[1] + 5}" + text[-1])
    anew = made_of(hotter, tmp_path)
    rest = rest_without(anew, "left", {0: 1})
    checked = written(rest, anew, alone, tmp_path)
    assert temperatures(Path(checked[0])) == [HOT[1], HOT[1], HOT[1] + 5, 0]
    assert "G1 E9" not in Path(checked[0]).read_text().split("M109 S235")[1]
    assert run(["verify", *checked]) == 0


def test_changes_that_are_not_understood_are_refused(made: Made, tmp_path: Path) -> None:
    """Who knows what a macro does there."""
    path = tmp_path / "in.gcode"
    path.write_text(made.path.read_text().replace("\nT1\nM109", "\nPICK_TOOL\nT1\nM109", 1))
    anew = made_of(path, tmp_path)
    with pytest.raises(InputError, match=r"what 'PICK_TOOL'.* does at a change of tools"):
        rest_without(anew, "left", {0: 1})
