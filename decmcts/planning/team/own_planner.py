"""A planner of one's own in the place of agents: one process, and what it offers is agreed on."""

from __future__ import annotations

import time
from collections.abc import Mapping

from agents.launch import LaunchResult
from agents.launching.spawn import Agreement
from agents.launching.status import AgentStatus, LaunchError, OnProgress
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.job import PrintJob
from decmcts.print.lags_kernels import Lags
from decmcts.print.machine import Machine
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.engine.plans import StatedOrder
from decmcts.team.engine.problem import build_team_problem
from decmcts.team.incumbent import Budget, TeamIncumbent
from decmcts.team.planner import TeamPlanner


def planned_by(
    planner: TeamPlanner,
    job: PrintJob,
    machine: Machine,
    graph: DependencyGraph,
    *,
    stopping: Stopping,
    seed: int,
    lags: Lags | None,
    start: StatedOrder | None,
    parameters: Mapping[str, float] | None,
    on_progress: OnProgress | None,
) -> LaunchResult:
    """Return what the planner finds, as if agents had agreed on it.

    Raises
    ------
    LaunchError
        If it offers no order that keeps all rules.
    """
    problem = build_team_problem(job, machine, graph, lags, start)
    best = TeamIncumbent(problem, Budget(stopping, time.monotonic))
    planner.plan(best, seed=seed)
    found, live = best.found, tuple(range(len(machine.heads)))
    if not found.toolpaths:
        raise LaunchError("the planner offered no order that keeps all rules")
    agents = tuple(
        AgentStatus(
            head, name, "released", live, found.orders, found.makespan_s, best.seconds,
            history=found.history,
        )
        for head, name in enumerate(problem.head_names)
    )  # fmt: skip
    if on_progress is not None:
        on_progress(agents)
    return LaunchResult(Agreement({}, found.makespan_s, "", live, agents), found.toolpaths)
