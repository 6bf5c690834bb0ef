"""A real print that ships with the project, planned by real agent processes."""

from __future__ import annotations

import os
import signal
from collections.abc import Mapping

import numpy as np
import pytest

from agents.launch import LaunchResult, launch
from agents.launching.status import AgentStatus
from agents.planners.pack import Pack, load_source
from decmcts.samples import sample_path
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.engine.problem import build_team_problem
from decmcts.team.engine.resolve import resolve
from decmcts.team.schedule.joint_plan import schedule

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def pack() -> Pack:
    return load_source(sample_path("four_nuts.gcode.gz"), "dual-gantry", "keep")


def assert_plan_holds(pack: Pack, result: LaunchResult) -> None:
    """Each contour once, by heads that took part, in an order the machine can execute."""
    orders = [path.order for path in result.toolpaths]
    assert np.sort(np.concatenate(orders)).tolist() == list(range(len(pack.job.contours)))
    idle = [head for head, order in enumerate(orders) if not len(order)]
    assert set(range(len(orders))) - set(idle) <= set(result.agreement.live)
    plan = schedule(pack.job, pack.machine, pack.graph, list(result.toolpaths))
    assert plan.makespan_s > 0


PLENTY_S = 600.0  # of planning: tests end it by what they saw, else a busy machine decides
Status = tuple[AgentStatus, ...]


class Watch:
    """Keeps what a launch said last."""

    def __init__(self) -> None:
        self.status: Status = ()

    def on_progress(self, status: Status) -> None:
        self.status = status

    def have_told(self) -> bool:
        told = [s.received.get("distribution", 0) for s in self.status]
        return bool(told) and all(told)


class Killer(Watch):
    """Kills one agent while both plan, and waits till the other plans alone."""

    def __init__(self, head: int) -> None:
        super().__init__()
        self.head, self.killed = head, False
        self.pids: Mapping[int, int] = {}
        self.started: list[int] = []

    def on_start(self, pids: Mapping[int, int]) -> None:
        self.pids = pids
        self.started += pids.values()

    def on_progress(self, status: Status) -> None:
        super().on_progress(status)
        if not self.killed and all(s.rounds and len(s.live) == 2 for s in status):
            assert all(s.phase == "planning" for s in status)
            self.killed = True
            os.kill(self.pids[self.head], signal.SIGKILL)

    def is_missed(self) -> bool:
        return self.killed and self.status[1 - self.head].live == (1 - self.head,)


def test_two_agents_agree_on_a_real_print_bit_for_bit(pack: Pack) -> None:
    """The main job of the project, from contours to toolpaths."""
    watch = Watch()
    result = launch(
        pack.job,
        pack.machine,
        pack.graph,
        stopping=Stopping(PLENTY_S, asked=watch.have_told),
        seed=3,
        on_progress=watch.on_progress,
    )
    agreement = result.agreement
    assert agreement.live == (0, 1)
    again = resolve(
        build_team_problem(pack.job, pack.machine, pack.graph), agreement.plans, agreement.live
    )
    assert (again.digest, again.makespan_s) == (agreement.digest, agreement.makespan_s)
    assert [dict(a.dropped) for a in agreement.agents] == [{}, {}]
    assert_plan_holds(pack, result)


@pytest.mark.long
def test_a_killed_agent_of_a_real_print_comes_back(pack: Pack) -> None:
    """kill -9 just before the end of planning: its head still has a share of the print."""
    killer = Killer(0)
    result = launch(
        pack.job,
        pack.machine,
        pack.graph,
        stopping=Stopping(PLENTY_S, asked=killer.is_missed),
        seed=3,
        on_start=killer.on_start,
        on_progress=killer.on_progress,
    )
    assert result.agreement.live == (0, 1)
    assert len(set(killer.started)) == 3
    assert_plan_holds(pack, result)
