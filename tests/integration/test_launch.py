"""Real processes over real zenoh on loopback, with deaths and hangs."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from agents.spawn import Agreement, run_agents
from agents.supervisor import AgentStatus, LaunchError
from tests.agents.toy import load_balance

TOY = (sys.executable, str(Path(__file__).with_name("toy_agent.py")))
pytestmark = pytest.mark.slow


class Saboteur:
    """Sends a signal to one agent once it has planned some rounds."""

    def __init__(self, head: int, number: int, *, after_s: float = 0.5) -> None:
        self.head, self.number, self.after_s = head, number, after_s
        self.pids: Mapping[int, int] = {}
        self.done_at: float | None = None

    def on_start(self, pids: Mapping[int, int]) -> None:
        self.pids = pids

    def on_progress(self, status: tuple[AgentStatus, ...]) -> None:
        watched = status[self.head]
        if self.done_at is None and len(watched.live) > 1 and watched.elapsed_s > self.after_s:
            os.kill(self.pids[self.head], self.number)
            self.done_at = watched.elapsed_s


def run(names: str, monkeypatch: pytest.MonkeyPatch, **options: object) -> Agreement:
    monkeypatch.setenv("TOY_HEADS", names)
    return run_agents(names.split(","), [], seed=1, command=TOY, **options)  # type: ignore[arg-type]


def assert_complete(agreement: Agreement) -> None:
    jobs = np.sort(np.concatenate(list(agreement.plans.values())))
    assert jobs.tolist() == list(range(40))
    lengths = np.random.default_rng(40).uniform(1.0, 9.0, 40)
    _, makespan = load_balance(lengths, agreement.plans, agreement.live)
    assert makespan == agreement.makespan_s


def test_two_processes_release_the_same_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    """The main job: each head its own process, one plan, bit for bit."""
    agreement = run("left,right", monkeypatch, time_limit_s=0.5)
    assert agreement.live == (0, 1)
    assert_complete(agreement)
    assert all(s.received["distribution"] > 0 for s in agreement.agents)


def test_a_killed_agent_s_work_is_taken_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """kill -9 in the middle still gives a valid plan of the others."""
    saboteur = Saboteur(2, signal.SIGKILL)
    agreement = run(
        "left,middle,right",
        monkeypatch,
        time_limit_s=1.5,
        on_progress=saboteur.on_progress,
        on_start=saboteur.on_start,
    )
    assert agreement.live == (0, 1)
    assert_complete(agreement)


def test_a_hung_agent_is_fenced_and_its_work_taken_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stopped process is seen by its lease, and killed before anything is released."""
    saboteur = Saboteur(0, signal.SIGSTOP)
    agreement = run(
        "left,right",
        monkeypatch,
        time_limit_s=1.0,
        on_progress=saboteur.on_progress,
        on_start=saboteur.on_start,
    )
    assert agreement.live == (1,)
    assert_complete(agreement)
    with pytest.raises(ProcessLookupError):
        os.kill(saboteur.pids[0], 0)


def test_another_problem_is_refused_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """Agents that hold different prints must not plan together."""
    monkeypatch.setenv("TOY_ODD_HEAD", "1")
    with pytest.raises(LaunchError, match=r"(left|right) holds problem [0-9a-f]{12}"):
        run("left,right", monkeypatch, time_limit_s=0.5)


def test_one_head_needs_no_network(monkeypatch: pytest.MonkeyPatch) -> None:
    """The single-extruder mode is the same process without peers."""
    agreement = run("only", monkeypatch, time_limit_s=0.2)
    assert agreement.live == (0,)
    assert_complete(agreement)
    assert not agreement.agents[0].sent
