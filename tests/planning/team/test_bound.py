"""Nobody waits long for a bound: a plan is worth more than what is proven of it."""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path

import numpy as np

from decmcts.planning.events import Event, Note
from decmcts.planning.options import NO_QUALITY, Freedom
from decmcts.planning.problem.planned import Planned, source_plan
from decmcts.planning.problem.print_problem import load
from decmcts.planning.team.joint import with_bound
from decmcts.team.bounds.makespan import Bound, makespan_bound
from decmcts.team.schedule.entries import OrderChoices, entries_of
from sim.faults import Verdict
from tests.planning.problem.test_first_check import LAYERS


def test_a_bound_that_is_not_found_in_time_is_a_simple_one(tmp_path: Path) -> None:
    """It is proven too, and no sharper; where the sharper one is there it is taken."""
    path = tmp_path / "in.gcode"
    path.write_text(LAYERS)
    problem, events = load(path, "dual-gantry", NO_QUALITY), list[Event]()
    before = source_plan(problem)
    planned = Planned(problem, before, before, Verdict(()), np.empty((0, 3)), {})
    late = with_bound(planned, Future(), events.append, wait_s=0.0).after.metrics["bound"]
    assert any(isinstance(event, Note) and "a simple one" in event.text for event in events)

    found = replace(makespan_bound(problem.job, problem.machine, problem.graph), bound_s=1.0)
    known = Future[Bound]()
    known.set_result(found)
    sharp = with_bound(planned, known, events.append, wait_s=0.0).after.metrics["bound"]
    assert 0.0 < late["bound_s"] < sharp["bound_s"] == found.bound_s


def test_a_simple_bound_holds_wherever_loops_are_entered(tmp_path: Path) -> None:
    """A loop that begins within a side stops there once more than one that begins at a corner."""
    path = tmp_path / "in.gcode"
    corners = ((60, 20), (60, 60), (20, 60), (20, 20), (39.7, 20))
    loop = "".join(f"G1 X{x} Y{y} E1 F6000\n" for x, y in corners)
    path.write_text(LAYERS.replace("M84", f";WIDTH:0.45\nG1 X40 Y20 F9000\n{loop}M84"))
    problem = load(path, "dual-gantry", replace(NO_QUALITY, freedom=Freedom.SEAM))
    before = source_plan(problem)
    planned = Planned(problem, before, before, Verdict(()), np.empty((0, 3)), {})
    late = with_bound(planned, Future(), lambda event: None, wait_s=0.0).after.metrics["bound"]
    entries = entries_of(problem.job, OrderChoices("seam"))
    assert entries is not None and len(entries.vertices) > len(problem.job.contours)
    sharp = makespan_bound(problem.job, problem.machine, problem.graph, entries=entries)
    assert late["serial_s"] <= sharp.serial_s
