"""What is done around the agents: whatever happens to them, the print gets a plan."""

from __future__ import annotations

import gzip
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest

from agents.launching.status import LaunchError
from decmcts.errors import InputError
from decmcts.formats.machines.machine_file import load_machine
from decmcts.planning.events import Begun, Event, Heads, Note, Sound, unheard
from decmcts.planning.one_head import pipeline as one_head
from decmcts.planning.options import Freedom, Limits, Objective, Rules, Seam, TeamSearch
from decmcts.planning.problem.print_problem import load, problem_of
from decmcts.planning.problem.source import read
from decmcts.planning.result import Result
from decmcts.planning.team.joint import Prepared, plan_alone
from decmcts.planning.team.pipeline import Launch, plan_team, prepared
from decmcts.planning.verify import verify
from decmcts.print.job import PrintJob
from decmcts.print.plan import PlanDocument
from decmcts.print.seam import seam_entries
from decmcts.print.toolpath import Toolpath
from decmcts.samples import sample_path
from decmcts.team.schedule.cooling import TimedOrder
from sim.verify import verify_plan
from tests.makers.agents import Agents
from tests.planning.one_head.test_cooling import towers
from tests.prints import four_parts

SEARCH = TeamSearch(0.5)


def none(*_: Any, **__: Any) -> NoReturn:
    """Stand for agents that come to no plan."""
    raise LaunchError("every agent ended")


@pytest.mark.slow
def test_agents_that_come_to_no_plan_leave_one_head() -> None:
    """Down to the single-extruder mode there is always a valid plan, and it is said."""
    events: list[Event] = []
    problem = load(sample_path("four_nuts.gcode.gz"), "dual-gantry")
    document = plan_team(problem, SEARCH, writes=False, report=events.append, agents=none).after
    assert Note("every agent ended; one head prints alone") in events
    assert sorted(len(head) > 0 for head in document.plan.heads) == [False, True]
    assert not verify_plan(document).faults


def test_events_come_in_turn(tmp_path: Path) -> None:
    """A listener may rely on it: the input is of use, there is something to keep, heads stand."""
    events: list[Event] = []
    problem = load(four_parts(tmp_path), "dual-gantry")
    plan_team(problem, SEARCH, writes=False, report=events.append, agents=none)
    assert [type(event) for event in events if isinstance(event, Sound | Begun | Heads)] == [
        Sound, Begun, Heads,
    ]  # fmt: skip


@pytest.mark.slow
def test_a_purge_line_that_is_left_out_is_noted(tmp_path: Path) -> None:
    """Of a plan alone nothing is left out."""
    source = tmp_path / "in.gcode"
    with gzip.open(sample_path("four_nuts.gcode.gz"), "rt") as file:
        source.write_text("G28\nM83\nG1 X0 Y0 Z.3\nG1 X60 E9 F1000\n" + file.read())
    problem = load(source, "dual-gantry")
    written = plan_team(problem, SEARCH, writes=True, agents=none).problem.job.notes
    assert any("extrudes 9.0 mm of filament on the bed" in note for note in written)
    assert any("prime each head" in note for note in written)
    shown = plan_team(problem, SEARCH, writes=False, agents=none).problem.job.notes
    assert not any("prime each head" in note for note in shown)


def launched(
    folder: Path,
    agents: Launch,
    rules: Rules = Rules(),  # noqa: B008 - frozen
    search: TeamSearch = SEARCH,
    limits: Limits = Limits.SOURCE,
) -> PlanDocument:
    """Plan the parts for two heads, have the files verified, return the plan."""
    path = four_parts(folder)
    problem = problem_of(read(path, "dual-gantry", limits=limits), rules, unheard)
    result = Result(plan_team(problem, search, writes=True, agents=agents), search)
    result.write_plan(folder / "plan.json")
    files = result.write_gcode(folder / "head").paths
    assert len(files) == 2
    assert verify(files, path, plan=folder / "plan.json").ok
    return result.document


@pytest.mark.slow
@pytest.mark.parametrize("objective", list(Objective))
def test_loops_are_entered_where_travels_are_short(
    agents: Agents, tmp_path: Path, objective: Objective
) -> None:
    """The files of all heads hold such loops, and the judge passes them."""
    sliced = launched(tmp_path, agents)
    search = TeamSearch(0.5, objective=objective)
    found = launched(tmp_path, agents, Rules(freedom=Freedom.SEAM), search)
    assert found.metrics["makespan_s"] < sliced.metrics["makespan_s"]
    assert found.metrics["extrusionless_travel_mm"] < sliced.metrics["extrusionless_travel_mm"]
    assert any((head.entry > 0).any() for head in found.plan.heads)
    said = [found.metrics[name] for name in ("planner", "freedom", "seam", "objective")]
    assert said == ["dec-mcts", "seam", "nearest", objective]
    assert found.rules is not None and found.rules.freedom == "seam"
    files, source = sorted(tmp_path.glob("head_*.gcode")), tmp_path / "parts.gcode"
    assert verify(files, source, "dual-gantry").ok
    entered = next(head for head in found.plan.heads if (head.entry > 0).any())
    row = entered.action_path(int(np.flatnonzero(entered.entry > 0)[0]))[-1]
    spoiled = next(path for path in files if path.stem.endswith(entered.head))
    end, beside = (f"X{row[0] + by:.3f} Y{row[1] + by:.3f} E" for by in (0.0, 0.1))
    assert end in spoiled.read_text()
    other = spoiled.read_text().replace(end, beside, 1)
    spoiled.write_text(other)
    assert not verify(files, source, "dual-gantry").ok


@pytest.mark.slow
@pytest.mark.parametrize("policy", [Seam.ALIGNED, Seam.REAR, Seam.CORNER])
def test_every_loop_begins_where_the_policy_says(
    agents: Agents, tmp_path: Path, policy: Seam
) -> None:
    """Whichever head prints it, and whether that takes longer or not."""
    document = launched(tmp_path, agents, Rules(freedom=Freedom.SEAM, seam=policy))
    entry = np.zeros(len(document.contours), np.int32)
    for head in document.plan.heads:
        printed = head.contour >= 0
        entry[head.contour[printed]] = head.entry[printed]
    assert entry.tolist() == seam_entries(document.contours, policy.value).vertices.tolist()


@pytest.mark.slow
def test_fixed_leaves_every_contour_as_sliced(agents: Agents, tmp_path: Path) -> None:
    """As for one head."""
    document = launched(tmp_path, agents, Rules(freedom=Freedom.FIXED))
    assert not any(head.reversed.any() or head.entry.any() for head in document.plan.heads)


@pytest.mark.slow
def test_limits_of_the_machine_go_before_the_source_s(agents: Agents, tmp_path: Path) -> None:
    """Every agent plans with them, and the bound is of them."""
    own = launched(tmp_path, agents).metrics["bound"]["serial_s"]
    theirs = launched(tmp_path, agents, limits=Limits.MACHINE).metrics["bound"]["serial_s"]
    (job, first), (_, second) = agents.given
    limits = load_machine("dual-gantry").limits
    assert first.limits == limits.under(job.limits) != limits
    assert second.limits == limits
    assert own != theirs


def test_asked_to_stop_nothing_is_searched(tmp_path: Path) -> None:
    """Not even for one head alone, which took up to ten seconds."""
    problem = load(four_parts(tmp_path), "dual-gantry")
    plan_team(problem, SEARCH, writes=False, agents=none)  # what is compiled once is compiled
    search, began = TeamSearch(30.0), time.monotonic()
    document = plan_team(problem, search, writes=False, agents=none, stop=lambda: True).after
    assert time.monotonic() - began < 5.0
    assert not verify_plan(document).faults


@pytest.mark.slow
def test_files_of_heads_say_that_the_makespan_came_first(agents: Agents, tmp_path: Path) -> None:
    """The objective of one head's own order stood there."""
    launched(tmp_path, agents)
    for path in tmp_path.glob("head_*.gcode"):
        assert "planner dec-mcts for makespan" in path.read_text()


class ShutIn:
    """Stands for `Prepared.schedule` where loops that are entered elsewhere shut heads in."""

    def __init__(self, ready: Prepared) -> None:
        self.ready = ready

    def __getattr__(self, name: str) -> Any:
        return getattr(self.ready, name)

    def schedule(self, toolpaths: Sequence[Toolpath]) -> Any:
        if any(path.entry.any() for path in toolpaths):
            raise InputError("heads shut each other in")
        return self.ready.schedule(toolpaths)


def test_one_head_alone_may_enter_loops_as_sliced(tmp_path: Path) -> None:
    """As sliced they can be printed; elsewhere one may be where another head cannot pass."""
    path, rules = four_parts(tmp_path), Rules(freedom=Freedom.SEAM)
    problem = problem_of(read(path, "dual-gantry"), rules, unheard)
    ready = prepared(problem, SEARCH, writes=False)
    assert ready.lone_order.entry.any()
    found = plan_alone(ShutIn(ready), [0, 1])  # type: ignore[arg-type]  # is one in all it has
    assert not any(head.entry.any() for head in found.plan.heads)
    assert not verify_plan(found).faults


def test_one_head_alone_is_as_good_as_a_plan_for_one_head(tmp_path: Path) -> None:
    """Its order was searched without regard to cooling and waited: heads seemed to gain by that."""
    path, rule = tmp_path / "towers.gcode", "; cooling = 1\n; slowdown_below_layer_time = 30\n"
    path.write_text(towers(tuple((x, y) for x in (30, 90, 150, 200) for y in (30, 90, 150)), rule))
    problem = load(path, "dual-gantry")
    ready = prepared(problem, TeamSearch(3.0), writes=False)
    found = plan_alone(ready, [0, 1])
    assert found.metrics["makespan_s"] <= ready.before.plan.makespan_s


def test_one_head_alone_is_never_slower_than_the_source(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A search prices neither all lifts nor all waits, so what it finds may end later."""

    def astray(job: PrintJob, *_: Any) -> TimedOrder:
        """Loops of all parts in turn: outer ones first, as sliced."""
        rows = np.arange(len(job.contours))
        strewn = np.lexsort((rows % 3, job.contours.layer)).astype(np.int32)
        return TimedOrder(replace(Toolpath.as_sliced(len(rows)), order=strewn), 0.0, 0.0, 0.0)

    monkeypatch.setattr(one_head, "cooled", astray)
    ready = prepared(load(four_parts(tmp_path), "dual-gantry"), SEARCH, writes=False)
    assert ready.lone_plan.makespan_s <= ready.before.plan.makespan_s
    assert np.array_equal(ready.lone_order.order, np.arange(len(ready.lone_order)))
