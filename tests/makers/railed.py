"""A print by hand on several heads of one rail, and heads of it that are taken to their parks."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from decmcts.experiments.made_print import made_gcode
from decmcts.formats.machines.machine_file import load_machine, rail_machine
from decmcts.planning.events import unheard
from decmcts.planning.options import Limits, Rules
from decmcts.planning.problem.planned import document_of
from decmcts.planning.problem.print_problem import problem_of
from decmcts.planning.problem.source import Source, read
from decmcts.print.machine import Machine, Point
from decmcts.print.plan import PlanDocument
from decmcts.print.print_state import PrintState, state_of_events
from decmcts.print.toolpath import Toolpath
from decmcts.team.schedule.joint_plan import schedule
from sim.controllers.from_plan import programs_of_plan
from sim.controllers.nearness import Course, Near, course_of, nearness, positions
from sim.controllers.simulate import events_of, simulate
from sim.controllers.timing import no_error

PARK_MM = 0.3  # lower than the print, so that heads must go over it
FEED = 100.0  # mm/s of what is replayed
_SKIRT = re.compile(r";TYPE:Skirt/Brim.*?G1 E-0.80000 F2100\n", re.S)  # no head reaches all of it
_WORD = re.compile(r"([XYZ])(-?[\d.]+)")


def railed(folder: Path, heads: int) -> tuple[PlanDocument, Source]:
    """A plan in which each head of a rail prints the tower before it, and its source."""
    machine = load_machine("dual-gantry")
    if heads > 2:
        machine = rail_machine(machine, heads)
    low = [replace(head, park=(*head.park[:2], PARK_MM)) for head in machine.heads]
    machine = replace(machine, heads=tuple(low))
    length = machine.bed_max[0]
    centres = [(length * (k + 0.5) / heads, 100.0 + 20.0 * (k % 2)) for k in range(heads)]
    path = folder / "in.gcode"
    path.write_text(_SKIRT.sub("", made_gcode(centres, size_mm=60.0, layers=3), count=1))
    source = read(path, machine, limits=Limits.MACHINE, report=unheard)
    problem = problem_of(source, Rules(), unheard)
    of = (problem.job.contours.start[:, 0] // (length / heads)).astype(np.int64)
    paths = []
    for k in range(heads):
        rows = np.flatnonzero(of == k).astype(np.int32)
        paths.append(Toolpath.of(rows, np.zeros(len(rows), np.bool_)))
    plan = schedule(problem.job, problem.machine, problem.graph, paths)
    return document_of(problem, plan, {}), replace(source, machine=problem.machine)


class Broken(NamedTuple):
    """A plan that was broken off at some moment."""

    state: PrintState  # by the events until then
    at: dict[str, Point]  # where heads stand


def broken_off(document: PlanDocument, times: Iterable[float]) -> Iterator[Broken]:
    """The plan as controllers carry it out, broken off at moments: shares of all its time."""
    found = simulate(programs_of_plan(document), document.machine)
    log = events_of(found, document.problem)
    courses = [
        course_of(program, profile, no_error(program), run)
        for program, profile, run in zip(
            found.programs, found.profiles, found.run.heads, strict=True
        )
    ]
    for share in times:
        time_s = share * max(event.time_s for event in log.events)
        until = tuple(event for event in log.events if event.time_s <= time_s)
        moment = np.array([found.begin_s + time_s])
        at = {
            name: tuple(positions(one, moment)[0].tolist())
            for name, one in zip(log.heads, courses, strict=True)
        }
        yield Broken(state_of_events(document, replace(log, events=until)), at)


def moves_of_text(text: bytes | str) -> list[dict[str, float]]:
    """The axis words of each move of a file, read by nobody else's code."""
    lines = (text.decode() if isinstance(text, bytes) else text).splitlines()
    return [
        {axis: float(value) for axis, value in _WORD.findall(line)}
        for line in lines if line.startswith("G1 ")
    ]  # fmt: skip


def moved(at: Point, moves: Sequence[Mapping[str, float]]) -> np.ndarray:
    """The points a head passes that stands at one place and makes these moves."""
    points = [np.array(at, float)]
    for words in moves:
        points.append(np.array([words.get(a, v) for a, v in zip("XYZ", points[-1], strict=True)]))
    return np.array(points)


def course(points: np.ndarray, begin_s: float) -> Course:
    """The course of a head that passes these points at an even speed."""
    length = np.maximum(np.linalg.norm(np.diff(points, axis=0), axis=1), 1e-6)
    ends = begin_s + np.cumsum(length) / FEED
    feed, one = np.full(len(length), FEED), np.ones(len(length))
    return Course(points, ends - length / FEED, ends, length, feed, feed, feed, 1e9 * one, one)


def replayed(
    machine: Machine, at: Mapping[str, Point], paths: Sequence[tuple[str, np.ndarray]], *,
    at_once: bool = False,
) -> tuple[Near, ...]:  # fmt: skip
    """How near heads come that stand there, when they make these paths in turn, or at once."""
    begin, courses = 0.0, {name: course(np.array([p, p]), 0.0) for name, p in at.items()}
    for name, points in paths:
        courses[name] = course(points, begin)
        begin = begin if at_once else float(courses[name].end[-1])
    heads = [machine.head(name) for name in courses]
    end_s = max(float(one.end[-1]) for one in courses.values())
    return nearness(machine, heads, list(courses.values()), 0.0, end_s)


def met(near: Sequence[Near]) -> bool:
    """Tell whether heads met."""
    return any(one.contacts for one in near)


def touched(
    machine: Machine, at: Mapping[str, Point], paths: Sequence[tuple[str, np.ndarray]]
) -> bool:
    """Tell whether heads come too near when they make these paths in turn; each 0.5 mm."""
    stands = {name: np.array(p, float) for name, p in at.items()}
    for name, points in paths:
        steps = [
            np.linspace(a, b, int(np.linalg.norm(b - a) / 0.5) + 2) for a, b in pairwise(points)
        ]
        way = np.concatenate(steps)
        for other, place in stands.items():
            if other != name and _too_near(machine, name, way, other, place):
                return True
        stands[name] = points[-1]
    return False


def _too_near(machine: Machine, name: str, way: np.ndarray, other: str, place: np.ndarray) -> bool:
    for rail in machine.rails:
        steps = rail.order.index(name) - rail.order.index(other)
        apart = (way[:, rail.axis] - place[rail.axis]) * np.sign(steps)
        if (apart < abs(steps) * rail.separation_mm - 1e-3).any():
            return True
    for mine, its in product(machine.head(name).bodies, machine.head(other).bodies):
        gap = np.maximum(
            way + mine.minimum - place - its.maximum, place + its.minimum - way - mine.maximum
        )
        if (np.linalg.norm(np.maximum(gap, 0.0), axis=1) < machine.head_clearance_mm - 1e-3).any():
            return True
    return False
