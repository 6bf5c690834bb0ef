"""Programs of plans."""

from __future__ import annotations

import numpy as np

from decmcts.print.plan import PlanDocument
from decmcts.print.toolpath import Toolpath
from decmcts.team.dec_mcts.warm_up import smallest_problem
from decmcts.team.schedule.joint_plan import schedule
from sim.controllers.from_plan import programs_of_plan
from sim.controllers.simulate import events_of, simulate


def test_a_head_with_nothing_to_do_stands_at_its_park() -> None:
    """It had stood where memory happened to say, and contacts were reported that were none."""
    problem = smallest_problem()
    job, machine, graph = problem.job, problem.machine, problem.graph
    nothing = Toolpath.of(np.empty(0, np.int32), np.empty(0, np.bool_))
    plan = schedule(job, machine, graph, [Toolpath.as_sliced(len(job.contours)), nothing])
    document = PlanDocument("", machine, job.contours, graph.pairs(), plan, {})
    programs = programs_of_plan(document)
    assert programs[1].points.tolist() == [list(machine.heads[1].park)]
    found = simulate(programs, machine)
    assert found.safe and found.trials[0].near[0].gap_mm > 0.0
    assert [event.head for event in events_of(found).events if event.head == 1] == []
    assert len(events_of(found).events) >= 2 * len(job.contours)  # each begins and ends
