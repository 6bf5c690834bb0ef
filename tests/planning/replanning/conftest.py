"""A small print on two heads, planned by hand: each tower by the head that is nearer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
import pytest

from agents.launching.status import LaunchError
from decmcts.experiments.made_print import made_gcode
from decmcts.formats.machines.machine_file import load_machine
from decmcts.planning.events import unheard
from decmcts.planning.options import Cut, Limits, Rules, TeamSearch
from decmcts.planning.problem.planned import document_of
from decmcts.planning.problem.print_problem import problem_of
from decmcts.planning.problem.source import Source, read
from decmcts.planning.result import Result
from decmcts.planning.team.pipeline import plan_team
from decmcts.print.machine import Fenced, Machine, Stands
from decmcts.print.plan import ActionKind, PlanDocument
from decmcts.print.print_events import EventKind, EventLog, PrintEvent
from decmcts.print.toolpath import Toolpath
from decmcts.team.schedule.joint_plan import schedule
from sim.faults import Fault
from sim.replay.fenced import check_fenced
from tests.makers.agents import Agents
from tests.makers.slab import slab_gcode


class Made(NamedTuple):
    """A plan that could be carried out, and its source as it is replanned."""

    document: PlanDocument
    source: Source
    path: Path


def read_made(path: Path) -> Source:
    """Read G-code for two heads, under the limits of the machine."""
    machine = load_machine("dual-gantry")
    return read(path, machine, limits=Limits.MACHINE, report=unheard)


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    path = tmp_path_factory.mktemp("made") / "in.gcode"
    path.write_text(made_gcode([(60, 100), (240, 100)]))
    source = read_made(path)
    problem = problem_of(source, Rules(), unheard)
    contours = problem.job.contours
    right = contours.start[:, 0] > 150.0
    paths = [
        Toolpath.of(rows.astype(np.int32), np.zeros(len(rows), np.bool_))
        for rows in (np.flatnonzero(~right), np.flatnonzero(right))
    ]
    plan = schedule(problem.job, problem.machine, problem.graph, paths)
    return Made(document_of(problem, plan, {}), replace(source, machine=problem.machine), path)


@pytest.fixture(scope="session")
def cut(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """A slab that two heads share: each of its contours is cut where that may be."""
    path = tmp_path_factory.mktemp("slab") / "in.gcode"
    text = slab_gcode(layers=5)
    path.write_text(text.replace("M107\n", "G1 E-1.00000 F2400\nM107\n", 1))
    source = read_made(path)
    search = TeamSearch(0.5, cut=Cut.ALL)
    problem = problem_of(source, Rules(), unheard)
    result = Result(plan_team(problem, search, writes=False, agents=Agents()), search)
    machine = result.document.machine
    return Made(result.document, replace(source, machine=machine), path)


def log_until(document: PlanDocument, time_s: float, *, failed: int | None = None) -> EventLog:
    """Return what happens up to a time of a plan; at last a head may fail there."""
    events = []
    for h, head in enumerate(document.plan.heads):
        for k in range(len(head)):
            path = head.action_path(k)
            if head.begin_s[k] < time_s:
                begin = tuple(path[0].tolist())
                events.append(PrintEvent(EventKind.BEGAN, h, float(head.begin_s[k]), k, 0, begin))
            if head.end_s[k] <= time_s:
                events.append(
                    PrintEvent(
                        EventKind.ENDED, h, float(head.end_s[k]), k, len(path) - 1,
                        tuple(path[-1].tolist()),
                    )
                )  # fmt: skip
            elif head.begin_s[k] < time_s and h == failed:
                at = tuple(((path[0] + path[1]) / 2.0).tolist())
                events.append(PrintEvent(EventKind.FAILED, h, time_s, k, 0, at, what="clogged"))
    names = tuple(head.head for head in document.plan.heads)
    return EventLog(document.problem, names, tuple(sorted(events, key=lambda e: e.time_s)))


def within_print(document: PlanDocument, head: int, after_s: float) -> tuple[float, int]:
    """Return a time at which a head is within a bead of several segments, and its action."""
    actions = document.plan.heads[head]
    for k in range(len(actions)):
        long = actions.kind[k] == ActionKind.PRINT and len(actions.action_path(k)) > 3
        if long and actions.begin_s[k] > after_s:
            return float(actions.begin_s[k] + actions.end_s[k]) / 2.0, k
    raise AssertionError("no such bead")


def faults_beside(
    document: PlanDocument, machine: Machine, places: dict[str, Stands]
) -> list[Fault]:
    """Return what the judge says of a plan beside heads that are fenced there."""
    return check_fenced(replace(document, fenced=Fenced(machine, places)))


@pytest.fixture
def alone() -> Any:
    """Agents that agree on nothing: one head prints what it reaches."""

    def none(*_: Any, **__: Any) -> NoReturn:
        raise LaunchError("none is there")

    return none
