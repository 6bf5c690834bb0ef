"""Changes of tools that are no walls: each head has one tool, keeps it hot, and waits less."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from decmcts.cli.run import run
from decmcts.formats.gcode import read_gcode
from decmcts.formats.gcode.document import IDLE_S
from decmcts.formats.gcode.reading.without_tower import without_tower
from decmcts.formats.gcode.writing.own_tools import Freed, with_own_tools
from decmcts.formats.mesh import SliceOptions
from decmcts.planning.options import RULES, Limits, Rules, TeamSearch
from decmcts.planning.problem.own_tools import team_problem
from decmcts.planning.problem.source import read_source
from decmcts.planning.result import Result
from decmcts.planning.team.pipeline import plan_team
from decmcts.print.contours import Role
from sim.experiments.made_print import made_tools_gcode
from sim.files.tower import read_without_tower
from sim.heads.changes import without_changes
from tests.planning.conftest import Agents
from tests.planning.writing.test_tools import (
    HOT,
    Source,
    machine_file,
    one_hot_end,
    temperatures,
    two_tools,
    without_blanks,
)


def launched(
    source: str, folder: Path, agents: Agents, rules: Rules = RULES
) -> tuple[Result, list[str], list[str]]:
    """Plan as `launch` does; return what was said, and the arguments that verify the files."""
    said: list[str] = []
    machine = machine_file(folder, 0, 1)
    given = read_source(
        Path(source), machine, limits=Limits.SOURCE, mesh=SliceOptions(),
        report=lambda event: None,
    )  # fmt: skip
    problem = team_problem(given, rules, lambda event: said.append(str(event)))
    search = TeamSearch(0.5)
    result = Result(plan_team(problem, search, writes=True, agents=agents), search)
    result.write_plan(folder / "plan.json")
    result.write_gcode(folder / "out")
    files = [str(folder / f"out_{name}.gcode") for name in ("left", "right")]
    return result, said, [*files, "--source", source]


def spoilt(path: str, spoil: Callable[[list[str]], None]) -> None:
    rows = Path(path).read_text().split("\n")
    spoil(rows)
    Path(path).write_text("\n".join(rows))


@pytest.mark.slow
@pytest.mark.parametrize(("relative", "blanks"), [(True, True), (False, False)])
def test_heads_keep_their_tool_hot_and_print_side_by_side(
    agents: Agents, tmp_path: Path, relative: bool, blanks: bool
) -> None:
    """No standby, no waiting for heat, and nobody waits for the other's part of a layer."""
    source = two_tools(tmp_path, relative=relative)
    if not blanks:
        without_blanks(source)
    result, _, files = launched(source, tmp_path, agents)
    assert [temperatures(Path(path)) for path in files[:2]] == [[HOT[0], 0], [HOT[1], HOT[1], 0]]
    assert result.after.print_time_s < 0.7 * result.before.print_time_s
    plan, machine = str(tmp_path / "plan.json"), str(tmp_path / "tools.toml")
    assert run(["verify", *files, "--plan", plan]) == 0
    assert run(["verify", *files, "--machine", machine]) == 0


def last_bead(rows: list[str]) -> int:
    return max(k for k, row in enumerate(rows) if row.startswith("G1 X") and " E0.6" in row)


def colder(rows: list[str]) -> None:
    """Cool the hot end before the last bead, as the source does between two uses of the tool."""
    rows.insert(last_bead(rows), "M104 S190")


def never_hot(rows: list[str]) -> None:
    """Leave the tool as warm as the other has to be."""
    rows[rows.index(f"M109 S{HOT[1]}")] = f"M109 S{HOT[0]}"


def pulled_for_a_change(rows: list[str]) -> None:
    """Pull the filament back as far as for a change that does not happen."""
    k = next(k for k, row in enumerate(rows) if row.startswith("G1 E-1"))
    rows[k] = rows[k].replace("E-1", "E-9")
    rows[k + 1 :] = [row.replace("G1 E1.", "G1 E9.") for row in rows[k + 1 :]]


def unprimed(rows: list[str]) -> None:
    """Leave out the push with which the tool is first taken."""
    rows.remove(next(row for row in rows if row.startswith("G1 E9")))


@pytest.mark.slow
def test_what_a_head_may_not_do_without_its_changes_is_found(
    agents: Agents, tmp_path: Path
) -> None:
    """Wrong heat, filament as for changes that are left out, and a bead by the other tool."""
    source = two_tools(tmp_path, relative=True)
    _, _, files = launched(source, tmp_path, agents)
    left, right = map(Path, files[:2])
    sound = left.read_text(), right.read_text()
    for spoil in (colder, never_hot, pulled_for_a_change, unprimed):
        spoilt(files[1], spoil)
        assert right.read_text() != sound[1]
        assert run(["verify", *files, "--plan", str(tmp_path / "plan.json")]) == 1, spoil
        right.write_text(sound[1])
    theirs = sound[1].split("\n")
    moved = theirs.pop(last_bead(theirs))
    ours = sound[0].split("\n")
    ours.insert(last_bead(ours) + 1, moved)
    left.write_text("\n".join(ours))
    right.write_text("\n".join(theirs))
    assert run(["verify", *files, "--plan", str(tmp_path / "plan.json")]) == 1
    assert run(["verify", *files, "--machine", str(tmp_path / "tools.toml")]) == 1


@pytest.mark.slow
def test_a_head_that_stood_idle_is_primed_as_behind_a_change(
    agents: Agents, tmp_path: Path
) -> None:
    """The source pushes 0.4 mm more than it pulls at each change; heads wait for cooling here."""
    source = Path(two_tools(tmp_path, relative=True))
    text = source.read_text().replace("G1 E9.00000", "G1 E9.40000").replace("F1800", "F300")
    source.write_text(text)
    result, _, files = launched(str(source), tmp_path, agents, Rules(min_layer_time_s=60.0))
    primed = [f"G1 E{1.4:.5f} F2400", f"G1 E{0.4:.5f} F2400"]
    for path, actions in zip(files, result.document.plan.heads, strict=False):
        rows = np.flatnonzero(actions.contour >= 0)
        waited = np.diff(actions.end_s[rows], prepend=0.0) - (
            actions.end_s[rows] - actions.begin_s[rows]
        )
        due = int((waited >= IDLE_S).sum())
        assert due == 1
        assert sum(row in primed for row in Path(path).read_text().split("\n")) == due
    plan, machine = str(tmp_path / "plan.json"), str(tmp_path / "tools.toml")
    assert run(["verify", *files, "--plan", plan]) == 0
    assert run(["verify", *files, "--machine", machine]) == 0
    sound = Path(files[1]).read_text()
    for less in (primed[0], "G1 E1.00000 F2400"):
        more = {primed[0]: "G1 E1.00000 F2400"}.get(less, primed[0])
        Path(files[1]).write_text(more.join(sound.rsplit(less, 1)))
        assert Path(files[1]).read_text() != sound
        assert run(["verify", *files, "--plan", plan]) == 1


@pytest.mark.slow
def test_a_macro_at_changes_keeps_them_walls_and_that_is_said(
    agents: Agents, tmp_path: Path
) -> None:
    """What it does is not known: it may move another head's filament, or need the tool parked."""
    source = Path(two_tools(tmp_path, relative=True))
    source.write_text(source.read_text().replace("T1\nM109", "T1\nM42 P1 S1\nM109"))
    result, said, _ = launched(str(source), tmp_path, agents)
    assert "M42 P1 S1" in " ".join(said) and "stay places nothing is moved across" in " ".join(said)
    assert result.document.contours.epoch.max() > 0


def test_another_temperature_behind_a_change_keeps_it_a_wall(tmp_path: Path) -> None:
    """A tool printed hotter at first: which beads it is hot for is not the planner's choice."""
    source = Path(two_tools(tmp_path, relative=True))
    first, hot, rest = source.read_text().rpartition(f"M109 S{HOT[1]}")
    source.write_text(f"{first}M109 S{HOT[1] - 10}{rest}")
    freed = with_own_tools(*read_gcode(source))
    judged = without_changes(*read_gcode(source))
    assert hot and isinstance(freed, Freed) and judged is not None
    assert freed.walls == 2  # where it cools down, and where it heats up to less
    assert freed.job.contours.epoch.tolist() == judged.job.contours.epoch.tolist()
    assert freed.job.contours.epoch.max() == 2


@pytest.mark.parametrize("made", ["relative", "absolute", "no blanks", "one hot end", "extras"])
def test_planner_and_judge_find_the_same(tmp_path: Path, made: str) -> None:
    """Each by logic of its own: where contours may move, and what each head starts with."""
    if made == "one hot end":
        source = one_hot_end(tmp_path, first="M104 S210\nM109 S210")
    else:
        source = two_tools(tmp_path, relative=made != "absolute")
    if made == "no blanks":
        without_blanks(source)
    if made == "extras":
        Path(source).write_text(made_tools_gcode(macro=False))
    job, document = read_gcode(Path(source))
    freed, judged = with_own_tools(job, document), without_changes(job, document)
    assert isinstance(freed, Freed) and judged is not None
    assert freed.count > 1 and freed.walls == (made == "extras")  # which has M104 S205 beside one
    ours, theirs = freed.job.contours, judged.job.contours
    assert ours.epoch.tolist() == theirs.epoch.tolist()
    assert freed.job.refills == judged.job.refills
    assert np.abs(freed.document.owed - judged.document.owed).max() < 1e-9
    assert freed.document.own_starts == judged.document.own_starts


TOWER = [
    ";TYPE:Wipe tower", ";WIDTH:0.5", "G1 X150 Y200 F9000",
    "; CP TOOLCHANGE START", "M220 B", "M220 S100", "G1 X170 E0.9 F1800", "T{tool}", "G4 S0",
    "G1 Y201 F1800", "G1 X150 E0.9 F1800", "M220 R", "G92 E0", "; CP TOOLCHANGE END",
    "G1 X150 Y205 E0.4 F1800",
]  # fmt: skip


def with_tower(folder: Path) -> str:
    """Write three layers of a part a tool, with a wipe tower at each change."""
    source = Source(relative=True)
    source.lines += [
        "; generated by PrusaSlicer 2.5.0",
        "G28",
        "G90",
        "M83",
        "M109 S210",
        "M220 S100",
        "T0",
    ]
    for layer, z in enumerate((0.2, 0.4, 0.6)):
        source.lines += [";LAYER_CHANGE", f";Z:{z}", ";HEIGHT:0.2", f"G1 Z{z} F720"]
        source.loop((60, 220)[layer % 2], z)
        source.lines += [row.format(tool=1 - layer % 2) for row in TOWER]
        source.loop((220, 60)[layer % 2], z)
    path = folder / "in.gcode"
    path.write_text("\n".join([*source.lines, "M104 S0", "M84", ""]))
    return str(path)


@pytest.mark.slow
def test_a_wipe_tower_is_left_out_only_as_asked(agents: Agents, tmp_path: Path) -> None:
    """With it changes stay walls; without it the judge misses it unless it was asked for."""
    source = with_tower(tmp_path)
    kept, said, _ = launched(source, tmp_path, agents)
    towers = kept.document.contours.role == Role.WIPE_TOWER
    assert towers.any() and "--without-tower" in " ".join(said)
    gone, _, files = launched(source, tmp_path, agents, Rules(without_tower=True))
    assert len(gone.document.contours) == len(kept.document.contours) - np.count_nonzero(towers)
    assert gone.document.contours.epoch.max() == 0
    assert any(
        "the wipe tower is left out, as asked" in line for line in gone.planned.problem.job.notes
    )
    plan, machine = str(tmp_path / "plan.json"), str(tmp_path / "tools.toml")
    for against in (["--plan", plan], ["--machine", machine]):
        assert run(["verify", *files, *against]) == 1
        assert run(["verify", *files, *against, "--without-tower"]) == 0


def test_planner_and_judge_leave_out_the_same_tower(tmp_path: Path) -> None:
    """Each by logic of its own, and nothing but beads of it: lines keep their numbers."""
    source = Path(with_tower(tmp_path))
    text, moves = without_tower(source.read_bytes(), source)
    assert moves == 3 * sum(" E0." in row for row in TOWER)
    _, document = read_gcode(source)
    assert read_without_tower(document)[1].text == text
    assert [len(text.split(b"\n"))] == [len(source.read_bytes().split(b"\n"))]


@pytest.mark.parametrize("machine", [None, "one tool"])
def test_a_tower_that_cannot_be_left_out_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], machine: str | None
) -> None:
    """Heads that change tools need it, and a source may have none."""
    named = machine_file(tmp_path, 0, 1) if machine else "dual-gantry"
    source = two_tools(tmp_path, relative=True) if machine else with_tower(tmp_path)
    assert run(["launch", source, "--machine", named, "--without-tower"]) == 2
    lines = [row for row in capsys.readouterr().err.splitlines() if row.startswith("decmcts: ")]
    assert len(lines) == 1 and "wipe tower" in lines[0]
