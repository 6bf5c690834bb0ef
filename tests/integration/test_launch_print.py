"""A real print that ships with the project, planned by real agent processes."""

from __future__ import annotations

import os
import signal
from collections.abc import Mapping

import numpy as np
import pytest

from agents.launch import LaunchResult, launch
from agents.pack import Pack
from agents.source import load_source
from agents.supervisor import AgentStatus
from decmcts.team.problem import build_team_problem
from decmcts.team.resolve import resolve
from decmcts.team.schedule import schedule
from examples import example_path

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def pack() -> Pack:
    return load_source(example_path("four_nuts.gcode.gz"), "dual-gantry", "keep")


def assert_plan_holds(pack: Pack, result: LaunchResult) -> None:
    """Each contour once, by heads that took part, in an order the machine can execute."""
    orders = [path.order for path in result.toolpaths]
    assert np.sort(np.concatenate(orders)).tolist() == list(range(len(pack.job.contours)))
    idle = [head for head, order in enumerate(orders) if not len(order)]
    assert set(range(len(orders))) - set(idle) <= set(result.agreement.live)
    plan = schedule(pack.job, pack.machine, pack.graph, list(result.toolpaths))
    assert plan.makespan_s > 0


def test_two_agents_agree_on_a_real_print_bit_for_bit(pack: Pack) -> None:
    """The main job of the project, from contours to toolpaths."""
    result = launch(pack.job, pack.machine, pack.graph, time_limit_s=1.0, seed=3)
    agreement = result.agreement
    assert agreement.live == (0, 1)
    again = resolve(
        build_team_problem(pack.job, pack.machine, pack.graph), agreement.plans, agreement.live
    )
    assert (again.digest, again.makespan_s) == (agreement.digest, agreement.makespan_s)
    assert all(a.received["distribution"] >= 1 and not a.dropped for a in agreement.agents)
    assert_plan_holds(pack, result)


def test_a_killed_agent_s_share_of_a_real_print_is_taken_over(pack: Pack) -> None:
    """kill -9 in the middle: the print still gets a valid plan, down to a single head."""
    pids: dict[int, int] = {}
    killed: list[int] = []

    def start(given: Mapping[int, int]) -> None:
        pids.update(given)

    def kill_when_planning(status: tuple[AgentStatus, ...]) -> None:
        if not killed and all(s.rounds for s in status):
            killed.append(pids[0])
            os.kill(pids[0], signal.SIGKILL)

    result = launch(
        pack.job,
        pack.machine,
        pack.graph,
        time_limit_s=4.0,
        seed=3,
        on_start=start,
        on_progress=kill_when_planning,
    )
    assert killed
    assert result.agreement.live == (1,)
    assert_plan_holds(pack, result)
