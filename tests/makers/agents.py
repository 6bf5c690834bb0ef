"""Heads that plan in this process, for what is done around them.

Two agents take seconds to start: few tests need more of them than that they agree.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

import pytest

from agents.launch import LaunchResult
from agents.launching.spawn import Agreement
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.dec_mcts.rounds import plan_in_turn
from decmcts.team.engine.problem import build_team_problem
from decmcts.team.engine.resolve import resolve


class Agents:
    """Agents that agree in this process and at once; keeps jobs and machines given to them."""

    def __init__(self) -> None:
        self.given: list[tuple[PrintJob, Machine]] = []

    def __call__(
        self,
        job: PrintJob,
        machine: Machine,
        graph: DependencyGraph,
        *,
        lags: Any,
        start: Any = None,
        **_: Any,
    ) -> LaunchResult:
        self.given.append((job, machine))
        problem = build_team_problem(job, machine, graph, lags, start)
        live = tuple(range(len(machine.heads)))
        best = plan_in_turn(problem, stopping=Stopping(iterations=1), seed=0)
        found = resolve(problem, best.plans, live)
        agreement = Agreement(best.plans, found.makespan_s, found.digest, live, ())
        return LaunchResult(agreement, found.toolpaths)


@contextmanager
def planned_here(agents: Agents) -> Iterator[None]:
    """Let `launch` plan with these, and start no process for a head."""
    launch = importlib.import_module("decmcts.planning.launch")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(launch, "launch_agents", agents)
        patch.setattr(launch, "crew_started", lambda heads: nullcontext())
        yield
