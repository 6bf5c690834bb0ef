"""Prints carried out by real processes over real zenoh, while heads fail and people interfere."""

from __future__ import annotations

import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from agents.messages.event_stream import read_events
from decmcts.formats.plans.plan_json import read_plan, write_plan
from decmcts.planning.events import Event, Note
from decmcts.planning.running.launcher import Launcher
from decmcts.planning.running.run import RunResult, run
from decmcts.planning.running.team import RunOptions
from decmcts.print.print_events import EventKind
from decmcts.print.print_state import state_of_events
from tests.makers.printed import printed_mm, printed_twice
from tests.planning.replanning.conftest import Made
from tests.planning.replanning.conftest import cut as _cut
from tests.planning.replanning.conftest import made as _made
from tests.planning.replanning.test_other_tools import made_of
from tests.planning.writing.test_own_tools import two_bars

made, cut = _made, _cut  # the fixtures
pytestmark = pytest.mark.slow
SPEED = 30.0
FAILS_S = 40.0  # of about 80: both heads print
Pids = Mapping[str, tuple[int, int]]


class Trial:
    """A run in which something happens at a time of the print."""

    def __init__(
        self, happens: Callable[[Trial, int, int], None], at_s: float = FAILS_S,
        head: str = "right",
    ) -> None:  # fmt: skip
        self.asked: queue.Queue[str | None] = queue.Queue()
        self.notes: list[str] = []
        self.failed = threading.Event()
        self.launcher: Launcher | None = None
        self._happens, self._at_s, self._head = happens, at_s, head
        self._over = threading.Event()

    def run(self, made: Made, options: RunOptions) -> RunResult:
        """Carry the plan out."""
        try:
            return run(
                made.document, made.source, options, asked=self.asked, report=self._report,
                on_start=self._start, on_launcher=lambda one: setattr(self, "launcher", one),
            )  # fmt: skip
        finally:
            self._over.set()

    def until(self, time_s: float) -> None:
        """Wait for a time of the print."""
        assert self.launcher is not None
        while self.launcher.team.clock.now() < time_s and not self._over.wait(0.002):
            pass

    def _report(self, event: Event) -> None:
        if isinstance(event, Note):
            self.notes.append(event.text)
            if " failed: " in event.text:
                self.failed.set()

    def _start(self, pids: Pids) -> None:
        def work() -> None:
            self.until(self._at_s)
            self._happens(self, *pids[self._head])
            self.asked.put(None)

        threading.Thread(target=work, daemon=True).start()


def assert_printed(made: Made, result: RunResult) -> None:
    """All is printed, once, and no heads touched."""
    assert result.complete and result.contacts == 0, (result.left, result.reason)
    assert printed_twice(result.plans) == 0
    contours = made.document.contours
    steps = np.linalg.norm(np.diff(contours.points, axis=0), axis=1)
    due = float(steps[contours.extrusion[1:] > 0.0].sum())  # no hops of pieces
    assert printed_mm(result.plans) == pytest.approx(due, abs=0.2)


def test_two_heads_print_a_plan(made: Made, tmp_path: Path) -> None:
    """The command line: files in, summary and events out; the events are the plan's."""
    plan, events = tmp_path / "plan.json", tmp_path / "events"
    write_plan(made.document, plan)
    command = [sys.executable, "-m", "decmcts.cli", "run", str(plan), "--simulated", "--json",
               "--speed", "50", "--events", str(events), "--watch"]  # fmt: skip
    done = subprocess.run(
        command, stdin=subprocess.DEVNULL, capture_output=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["complete"] and found["unprinted"] == 0 and not found["failures"]
    assert found["makespan_s"] == pytest.approx(found["planned_s"], rel=0.25)
    state = state_of_events(read_plan(plan), read_events(events))
    assert state.done.all()


def test_a_run_that_is_stopped_leaves_what_happened(made: Made, tmp_path: Path) -> None:
    """The rest is planned from that; before, no events were written."""
    plan, events = tmp_path / "plan.json", tmp_path / "events"
    write_plan(made.document, plan)
    command = [sys.executable, "-m", "decmcts.cli", "run", str(plan), "--simulated",
               "--speed", "5", "--events", str(events)]  # fmt: skip
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as run_on:
        while run_on.poll() is None and (not events.exists() or events.stat().st_size < 1000):
            time.sleep(0.02)
        run_on.send_signal(signal.SIGINT)
        _, said = run_on.communicate(timeout=60)
    assert run_on.returncode == 130 and f"until then is in {events}" in " ".join(said.split())
    state = state_of_events(read_plan(plan), read_events(events))
    assert not state.done.all() and not any(head.begun for head in state.heads)


FAULTS: dict[str, Callable[[Trial, int, int], None]] = {
    "agent killed": lambda _, agent, __: os.kill(agent, signal.SIGKILL),
    "agent hangs": lambda _, agent, __: os.kill(agent, signal.SIGSTOP),
    "bus lost": lambda _, agent, __: os.kill(agent, signal.SIGUSR2),
    "clogged": lambda _, __, controller: os.kill(controller, signal.SIGUSR1),
}


@pytest.mark.parametrize(
    ("fault", "head"),
    [
        ("agent killed", "right"),
        ("clogged", "right"),
        pytest.param("clogged", "left", marks=pytest.mark.long),
        pytest.param("agent hangs", "right", marks=pytest.mark.long),  # as killed, noticed later
        pytest.param("bus lost", "left", marks=pytest.mark.long),
    ],
)
def test_the_rest_is_printed_by_the_others(made: Made, fault: str, head: str) -> None:
    """The controller lives: it says that it is off and goes to its park, and all is finished."""
    at_s = 25.0 if fault == "bus lost" else FAILS_S  # that takes 3 s of the world to notice
    result = Trial(FAULTS[fault], at_s, head).run(made, RunOptions(SPEED, replan_s=0.5))
    (failure,) = result.failures
    assert failure.head == head
    assert sum(carried.is_print for carried in result.plans) in (1, 2)  # it may have been done
    assert_printed(made, result)
    if len(result.plans) > 1:
        assert failure.on_s >= failure.fenced_s >= failure.at_s


@pytest.mark.long
def test_a_head_may_fail_as_soon_as_time_begins(made: Made) -> None:
    """The others had not heard that it holds the plan, and waited for that for ever."""
    result = Trial(FAULTS["agent killed"], 0.0).run(made, RunOptions(SPEED, replan_s=0.5))
    assert len(result.plans) > 1 and len(result.failures) == 1
    assert_printed(made, result)


@pytest.mark.long
def test_the_rest_of_a_cut_plan_is_printed_by_the_others(cut: Made) -> None:
    """All of each contour, whichever pieces of it were printed when an agent was killed."""
    assert cut.document.contours.of is not None
    at_s = 0.3 * cut.document.plan.makespan_s
    result = Trial(FAULTS["agent killed"], at_s).run(cut, RunOptions(SPEED, replan_s=0.5))
    assert len(result.plans) > 1, "it failed too late"
    assert_printed(cut, result)


@pytest.mark.long
def test_another_tool_prints_for_a_dead_heads(tmp_path: Path) -> None:
    """All is finished where a person has allowed it, and what is of which tool is said."""
    folder = tmp_path / "tools"
    folder.mkdir()
    made = made_of(Path(two_bars(folder)), folder, (1, 0))
    options = RunOptions(SPEED, replan_s=0.5, print_with=((0, 1),))
    result = Trial(FAULTS["clogged"], 60.0).run(made, options)
    assert len(result.plans) > 1, "it failed too late"
    assert_printed(made, result)
    (words,) = result.others
    assert words.endswith("of tool 0 are printed with tool 1's filament")
    assert not Trial(FAULTS["clogged"], 60.0).run(made, replace(options, print_with=())).complete


def nobody_enters(result: RunResult) -> None:
    """Until a person came, the other head began nothing that waits for the dead one's actions."""
    (failure,) = result.failures
    first = result.plans[0]
    dead = [event for event in first.events if event.head == 1 and event.kind is EventKind.ENDED]
    ended = max((event.action for event in dead), default=-1)
    for event in first.events:
        if event.head == 0 and event.kind is EventKind.BEGAN:
            edges = first.document.plan.heads[0].after_edges(event.action)
            assert all(edge.action <= ended + 1 for edge in edges if edge.head == 1)
    assert failure.fenced_s >= failure.noticed_s


@pytest.mark.parametrize(
    "number", [signal.SIGKILL, pytest.param(signal.SIGSTOP, marks=pytest.mark.long)]
)
def test_a_person_fences_a_lost_controller(made: Made, number: int) -> None:
    """Nobody knows where its head is until somebody looks; what its bead lacks is said."""

    def happens(trial: Trial, _: int, controller: int) -> None:
        os.kill(controller, number)
        assert trial.failed.wait(30.0)
        assert trial.launcher is not None
        trial.until(trial.launcher.team.clock.now() + 20.0)
        trial.asked.put("fenced nobody park")
        trial.asked.put("fenced right park")

    trial = Trial(happens)
    result = trial.run(made, RunOptions(SPEED, replan_s=0.5))
    assert result.unprinted == 0 and result.contacts == 0 and printed_twice(result.plans) == 0
    assert all("at most of it are missing" in line for line in result.left)
    assert any("no head nobody" in note for note in trial.notes)
    nobody_enters(result)


@pytest.mark.long
def test_a_lost_controller_that_nobody_fences_ends_the_run(made: Made) -> None:
    """What needs nothing of it is printed; the rest is honestly not."""
    result = Trial(lambda _, __, controller: os.kill(controller, signal.SIGKILL)).run(
        made, RunOptions(SPEED, replan_s=0.5)
    )
    assert not result.complete and result.unprinted > 0 and result.contacts == 0
    assert len(result.plans) == 1
    nobody_enters(replace(result, failures=(replace(result.failures[0], fenced_s=float("inf")),)))


@pytest.mark.long
def test_a_head_may_fail_in_two_ways(made: Made) -> None:
    """Its agent is killed, and before its controller has said where it stands that is killed too.

    Nobody was asked where the head is, and the run waited for ever.
    """

    def happens(trial: Trial, agent: int, controller: int) -> None:
        os.kill(controller, signal.SIGSTOP)  # it says nothing any more
        os.kill(agent, signal.SIGKILL)
        assert trial.failed.wait(30.0)
        os.kill(controller, signal.SIGKILL)
        assert trial.launcher is not None
        trial.until(trial.launcher.team.clock.now() + 20.0)
        trial.asked.put("fenced right park")

    trial = Trial(happens)
    result = trial.run(made, RunOptions(SPEED, replan_s=0.5))
    assert any("say `fenced right" in note for note in trial.notes)
    assert result.unprinted == 0 and result.contacts == 0 and printed_twice(result.plans) == 0
    nobody_enters(result)


@pytest.mark.parametrize(
    ("fault", "at_s"), [("agent killed", 1.0), pytest.param("clogged", 9.0, marks=pytest.mark.long)]
)
def test_a_run_ends_when_no_head_works_any_more(made: Made, fault: str, at_s: float) -> None:
    """The other head fails too, before the rest is planned or on its way to its park."""

    def happens(trial: Trial, agent: int, controller: int) -> None:
        FAULTS[fault](trial, agent, controller)
        assert trial.launcher is not None
        trial.until(trial.launcher.team.clock.now() + at_s)
        left = trial.launcher.team.processes[0]
        FAULTS[fault](trial, left.agent.pid, left.controller_pid)

    result = Trial(happens).run(made, RunOptions(SPEED, replan_s=0.5))
    assert len(result.failures) == 2 and result.contacts == 0
    assert not result.complete and result.unprinted > 0
    assert "no head works any more" in result.reason


def test_loss_and_delay_cost_time_only(made: Made) -> None:
    """A fifth of the messages is lost, the others come up to half a second late."""
    options = RunOptions(SPEED, loss=0.2, delay_s=0.5, seed=3)
    result = Trial(lambda *_: None).run(made, options)
    assert not result.failures
    assert_printed(made, result)


def test_people_pause_resume_and_abort(made: Made) -> None:
    """A paused head stands; an aborted print ends as it is."""

    def happens(trial: Trial, *_: int) -> None:
        trial.asked.put("pause right\n")
        trial.until(FAILS_S + 60.0)
        trial.asked.put("resume")
        trial.until(FAILS_S + 70.0)
        trial.asked.put("abort")

    result = Trial(happens).run(made, RunOptions(SPEED))
    begun = [e.time_s for e in result.plans[0].events if e.head == 1 and e.kind is EventKind.BEGAN]
    gaps = [b - a for a, b in pairwise(begun)]
    assert max(gaps) > 40.0, (gaps, result.makespan_s, result.waits)
    assert len(result.failures) == 2 and {f.why for f in result.failures} == {"aborted"}
    assert not result.complete and result.contacts == 0
    assert len(result.plans) == 1
