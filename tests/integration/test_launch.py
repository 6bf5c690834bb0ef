"""Real processes over real zenoh on loopback, with deaths and hangs."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import msgpack
import numpy as np
import pytest
import zenoh

from agents.launching.places import Places
from agents.launching.spawn import Agreement, Crew, run_agents
from agents.launching.status import AgentStatus, LaunchError
from agents.messages.codec import MAX_MESSAGE_BYTES
from agents.messages.keys import Keys
from agents.networks.meeting import Meeting
from agents.networks.zenoh_session import configured
from decmcts.search.sequence.stopping import Stopping
from tests.agents.toy import load_balance

TOY = (sys.executable, str(Path(__file__).with_name("toy_agent.py")))
pytestmark = pytest.mark.slow


PLENTY_S = 120.0  # of planning, and of waiting: no test ends by this, but where it fails
Status = tuple[AgentStatus, ...]


class Until:
    """Watches a launch and asks for the end of planning once it has seen what it waits for.

    By the clock a busy machine could be done with planning before a test begins.
    """

    def __init__(self, seen: Callable[[Status], bool]) -> None:
        self.seen = seen
        self.pids: Mapping[int, int] = {}
        self.status: Status = ()

    def on_start(self, pids: Mapping[int, int]) -> None:
        self.pids = pids

    def on_progress(self, status: Status) -> None:
        self.status = status

    def is_seen(self) -> bool:
        planning = bool(self.status) and all(s.rounds for s in self.status)
        return planning and self.seen(self.status)  # earlier, a launch has nothing to end


class Saboteur(Until):
    """Sends a signal to one agent once all plan together, and waits till the others miss it."""

    def __init__(self, head: int, number: int) -> None:
        super().__init__(self.is_missed)
        self.head, self.number = head, number
        self.struck = False

    def on_progress(self, status: Status) -> None:
        super().on_progress(status)
        if not self.struck and all(s.rounds and len(s.live) == len(status) for s in status):
            assert all(s.phase == "planning" for s in status)
            self.struck = True
            os.kill(self.pids[self.head], self.number)

    def is_missed(self, status: Status) -> bool:
        others = [s for s in status if s.head != self.head]
        return self.struck and all(s.live and self.head not in s.live for s in others)


class Revival(Until):
    """Kills agents whenever all plan together, so often, and waits for what comes of it."""

    def __init__(self, *heads: int, kills: int = 1) -> None:
        super().__init__(self.is_settled)
        self.heads, self.kills, self.struck = heads, kills, 0
        self.starts: set[int] = set()

    def on_start(self, pids: Mapping[int, int]) -> None:
        super().on_start(pids)
        self.starts |= set(pids.values())

    def on_progress(self, status: Status) -> None:
        super().on_progress(status)
        due = len(status) + self.struck * len(self.heads)
        if self.struck < self.kills and len(self.starts) == due and plan_together(status):
            self.struck += 1
            for head in self.heads:
                os.kill(self.pids[head], signal.SIGKILL)

    def is_settled(self, status: Status) -> bool:
        lost = all(status[head].phase == "lost" for head in self.heads)
        back = len(self.starts) == len(status) + len(self.heads) and plan_together(status)
        return self.struck == self.kills and (lost if self.kills > 1 else back)


def plan_together(status: Status) -> bool:
    return all(s.rounds and len(s.live) == len(status) for s in status)


def run(
    names: str,
    monkeypatch: pytest.MonkeyPatch,
    *arguments: str,
    until: Until | None = None,
    meeting: Meeting | None = None,
) -> Agreement:
    monkeypatch.setenv("TOY_HEADS", names)
    watch = until or Until(lambda status: all(s.rounds for s in status))
    return run_agents(
        names.split(","),
        arguments,
        stopping=Stopping(PLENTY_S, asked=watch.is_seen),
        seed=1,
        command=TOY,
        on_start=watch.on_start,
        on_progress=watch.on_progress,
        meeting=meeting,
    )


def assert_live(agreement: Agreement, *heads: int) -> None:
    """Who is left; a failure shows what became of the others."""
    lost = {s.head: s.note for s in agreement.agents if s.head not in agreement.live}
    assert agreement.live == heads, lost


def assert_complete(agreement: Agreement) -> None:
    jobs = np.sort(np.concatenate(list(agreement.plans.values())))
    assert jobs.tolist() == list(range(40))
    lengths = np.random.default_rng(40).uniform(1.0, 9.0, 40)
    _, makespan = load_balance(lengths, agreement.plans, agreement.live)
    assert makespan == agreement.makespan_s


def test_two_processes_release_the_same_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    """The main job: each head its own process, one plan, bit for bit."""
    told = Until(lambda status: all(s.received.get("distribution", 0) for s in status))
    agreement = run("left,right", monkeypatch, until=told)
    assert_live(agreement, 0, 1)
    assert_complete(agreement)


def test_planning_ends_by_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody asks for the end, as without a terminal."""
    monkeypatch.setenv("TOY_HEADS", "left,right")
    agreement = run_agents(["left", "right"], [], stopping=Stopping(0.2), seed=1, command=TOY)
    assert_live(agreement, 0, 1)
    assert_complete(agreement)


@pytest.mark.parametrize("names", ["left,right", "left,middle,right"])
def test_a_killed_agent_is_started_again_and_its_head_planned_for(
    names: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A process that dies is no dead head: before, the others printed all."""
    agreement = run(names, monkeypatch, until=Revival(1))
    assert_live(agreement, *range(len(names.split(","))))
    assert_complete(agreement)
    assert [agent.again for agent in agreement.agents][:2] == ["", "killed by SIGKILL"]


def test_an_agent_is_started_again_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """What kills it twice would kill it a third time."""
    revival = Revival(1, kills=2)
    agreement = run("left,middle,right", monkeypatch, until=revival)
    assert len(revival.starts) == 4
    assert_live(agreement, 0, 2)
    assert_complete(agreement)


def test_agents_that_all_die_all_come_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody is left who knows what was planned."""
    agreement = run("left,right", monkeypatch, until=Revival(0, 1))
    assert_live(agreement, 0, 1)
    assert_complete(agreement)


@pytest.mark.long
def test_a_hung_agent_is_fenced_and_its_work_taken_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stopped process is seen by its lease, and killed before anything is released."""
    saboteur = Saboteur(0, signal.SIGSTOP)
    agreement = run("left,right", monkeypatch, until=saboteur)
    assert_live(agreement, 1)
    assert_complete(agreement)
    with pytest.raises(ProcessLookupError):
        os.kill(saboteur.pids[0], 0)


@pytest.mark.long
def test_a_stuck_planner_is_fenced_though_its_network_lives(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Zenoh's threads keep its lease; before, the launch waited two minutes and gave it up.

    A silence of 1.5 s is one a busy machine gives a healthy agent now and then.
    """
    began = time.monotonic()
    stuck = Saboteur(1, signal.SIGUSR1)
    agreement = run("left,middle,right", monkeypatch, "--silence", "5", until=stuck)
    assert_live(agreement, 0, 2)
    assert_complete(agreement)
    assert time.monotonic() - began < 60.0


def test_an_agent_told_to_end_says_goodbye_and_the_rest_go_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """SIGTERM is a leave, not a crash."""
    agreement = run("left,right", monkeypatch, until=Saboteur(1, signal.SIGTERM))
    assert_live(agreement, 0)
    assert_complete(agreement)


def shout(meeting: Meeting, ended: threading.Event) -> None:
    """Be a hostile neighbour who is let in: garbage, forgeries, giants under both heads' keys."""
    rng = np.random.default_rng(3)
    keys, giant = Keys(meeting.seal), bytes(MAX_MESSAGE_BYTES + 100_000)
    forged = msgpack.packb(["goodbye", 1, 1, 2**62, "", "forged"])
    at = [f"unixsock-stream/{Path(meeting.places[0]).parent.name}/none", *meeting.places]
    with configured(at[0], at[1:], meeting.seal) as config:
        config.insert_json5("listen/endpoints", "[]")
        hostile = zenoh.open(config)
    with hostile:
        tokens = []
        while not ended.wait(0.02):
            for head in (0, 1, 77):
                key = keys.message(head, "commit")
                hostile.put(key, rng.bytes(int(rng.integers(0, 2000))))
                hostile.put(keys.message(head, "goodbye"), forged)
                hostile.put(key, meeting.seal.close(b"\xdd\xff\xff\xff\xff"))
            if len(tokens) < 50:
                key = keys.alive(1, 2**60 + len(tokens))
                tokens.append(hostile.liveliness().declare_token(key[:-4] + "abcd"))
            hostile.put(keys.message(0, "reply"), giant)


def has_dropped_much(status: Status) -> bool:
    dropped = status[0].dropped
    kinds = ("forged message", "forged token", "malformed message of head 1", "strange key")
    return all(dropped.get(kind, 0) > 10 for kind in kinds)


def test_forged_malformed_and_oversized_messages_change_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Whoever shares the bus must not stop a print; and what was tried is counted."""
    with Places(2) as places:
        meeting, over = Meeting(places.fresh(), b"known to the neighbour"), threading.Event()
        neighbour = threading.Thread(target=shout, args=(meeting, over))
        neighbour.start()
        try:
            until = Until(has_dropped_much)
            agreement = run("left,right", monkeypatch, until=until, meeting=meeting)
        finally:
            over.set()
            neighbour.join()
    assert_live(agreement, 0, 1)
    assert_complete(agreement)
    assert has_dropped_much(agreement.agents)


class Sleeper(Saboteur):
    """Stops an agent, lets it go on when the others miss it, waits till they plan with it again."""

    def __init__(self, head: int) -> None:
        super().__init__(head, signal.SIGSTOP)
        self.resumed = False

    def on_progress(self, status: Status) -> None:
        super().on_progress(status)
        if not self.resumed and self.is_missed(status):
            self.resumed = True
            os.kill(self.pids[self.head], signal.SIGCONT)

    def is_seen(self) -> bool:
        return self.resumed and all(len(s.live) == len(self.status) for s in self.status)


def test_a_hung_agent_that_goes_on_takes_part_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its lease ran out, the others planned on without it, and then it is back."""
    agreement = run("left,middle,right", monkeypatch, until=Sleeper(1))
    assert_live(agreement, 0, 1, 2)
    assert_complete(agreement)


@contextmanager
def launcher(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[subprocess.Popen[str], list[int]]]:
    """A launcher with a minute to plan, and the process ids of its agents."""
    monkeypatch.setenv("TOY_HEADS", "left,right")
    script = str(Path(__file__).with_name("toy_launch.py"))
    with subprocess.Popen(
        [sys.executable, script, "60"], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        pids = [int(pid) for pid in process.stdout.readline().split()]
        assert process.stdout.readline() == "planning\n"
        yield process, pids
        process.kill()


def ended(pids: list[int], within_s: float = 5.0) -> bool:
    deadline = time.monotonic() + within_s
    while time.monotonic() < deadline:
        if not any(Path(f"/proc/{pid}/cmdline").exists() for pid in pids):
            return True
        time.sleep(0.05)
    return False


def test_ctrl_c_ends_in_the_best_plan_so_far(monkeypatch: pytest.MonkeyPatch) -> None:
    """A minute of planning is asked for; the user has seen enough."""
    with launcher(monkeypatch) as (process, pids):
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=60)
        digest, *live = output.split()
        assert len(digest) == 32 and live == ["0", "1"]
        assert process.returncode == 0
        assert ended(pids)


def test_a_stop_asked_for_by_the_caller_ends_in_the_best_plan_so_far(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The command line owns Ctrl-C and asks in its own way."""
    late = Until(lambda status: min(s.rounds for s in status) > 50)
    agreement = run("left,right", monkeypatch, until=late)
    assert_live(agreement, 0, 1)
    assert_complete(agreement)


def test_agents_do_not_outlive_a_killed_launcher(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody would collect their plan, and they would eat a core each."""
    with launcher(monkeypatch) as (process, pids):
        process.kill()
        process.wait()
        assert ended(pids)


def test_agents_that_wait_do_not_outlive_a_killed_launcher() -> None:
    """They are importing then, and look at no pipe of their own accord."""
    script = "from agents.launching.spawn import Crew; import time\n"
    script += "with Crew(2) as crew:\n"
    script += "    print(*(a.pid for a in crew.agents.values()), flush=True)\n    time.sleep(60)"
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        pids = [int(pid) for pid in process.stdout.readline().split()]
        assert all(Path(f"/proc/{pid}/cmdline").exists() for pid in pids)
        process.kill()
        process.wait()
        assert ended(pids, within_s=20.0)  # a busy machine takes long to start Python at all


def waiting_agent(monkeypatch: pytest.MonkeyPatch) -> subprocess.Popen[bytes]:
    """Start an agent that loads, and then waits for its arguments."""
    monkeypatch.setenv("TOY_HEADS", "left,right")
    pipe = subprocess.PIPE
    return subprocess.Popen([*TOY, "--piped"], stdin=pipe, stdout=pipe, stderr=pipe)


def test_a_waiting_agent_whose_pipe_closes_ends_in_silence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """After loading it waits for its problem; the launcher may end by then without one."""
    with waiting_agent(monkeypatch) as agent:
        out, err = agent.communicate(timeout=30)
    assert (agent.returncode, err) == (0, b"")
    assert set(out.splitlines()) <= {b'{"event": "pulse"}'}  # of one that loads slowly


def test_a_waiting_agent_that_is_handed_something_else_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It would end as if it had planned."""
    with waiting_agent(monkeypatch) as agent:
        assert agent.stdin is not None and agent.stderr is not None
        agent.stdin.write(b"--head 0\n")
        agent.stdin.flush()  # and kept open: without a launcher it ends in silence
        assert agent.wait(30) == 2
        said = agent.stderr.read()
    assert said.startswith(b"decmcts: the first line on stdin") and said.count(b"\n") == 1


def test_agents_that_started_early_plan_as_others_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """They are handed their problem later; nothing of it stands on their command line."""
    monkeypatch.setenv("TOY_HEADS", "left,right")
    seen: list[str] = []
    told = Until(lambda status: all(s.received.get("distribution", 0) for s in status))

    def on_start(pids: Mapping[int, int]) -> None:
        told.on_start(pids)
        seen.extend(Path(f"/proc/{pid}/cmdline").read_text() for pid in pids.values())

    with Crew(2, TOY) as crew:
        early = [agent.pid for agent in crew.agents.values()]
        agreement = run_agents(
            ["left", "right"],
            [],
            stopping=Stopping(PLENTY_S, asked=told.is_seen),
            seed=1,
            crew=crew,
            on_start=on_start,
            on_progress=told.on_progress,
        )
        assert ended(early)  # their share of the processor goes to what comes next
    assert list(told.pids.values()) == early
    assert_live(agreement, 0, 1)
    assert_complete(agreement)
    assert not any("session" in words or "ports" in words for words in seen)


def test_an_agent_that_died_while_it_waited_is_started_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The other has not begun to plan, and waits for it."""
    monkeypatch.setenv("TOY_HEADS", "left,right")
    with Crew(2, TOY) as crew:
        crew.agents[1].kill()
        agreement = run_agents(["left", "right"], [], stopping=Stopping(0.2), seed=1, crew=crew)
    assert_live(agreement, 0, 1)
    assert_complete(agreement)


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_a_launch_that_ends_before_planning_ends_its_agents(error: type[BaseException]) -> None:
    """Refused input, or Ctrl-C: at once and for sure, for nobody has met them yet."""
    pids: list[int] = []
    with pytest.raises(error), Crew(2) as crew:
        pids += [agent.pid for agent in crew.agents.values()]
        raise error
    assert len(pids) == 2
    with pytest.raises(ProcessLookupError):  # waited for as well
        os.kill(pids[0], 0)
    assert ended(pids, within_s=1.0)


def test_a_crash_is_one_line() -> None:
    """People read the last line; a trace of another process helps nobody."""
    with pytest.raises(LaunchError, match="every agent ended: /nowhere: no problem pack"):
        run_agents(
            ["a", "b"],
            ["--pack", "/nowhere"],
            seed=1,
            stopping=Stopping(1.0),
        )


def test_another_problem_is_refused_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """Agents that hold different prints must not plan together."""
    monkeypatch.setenv("TOY_ODD_HEAD", "1")
    with pytest.raises(LaunchError, match=r"(left|right) holds problem [0-9a-f]{12}"):
        run("left,right", monkeypatch)


def test_one_head_needs_no_network(monkeypatch: pytest.MonkeyPatch) -> None:
    """The single-extruder mode is the same process without peers."""
    agreement = run("only", monkeypatch)
    assert_live(agreement, 0)
    assert_complete(agreement)
    assert not agreement.agents[0].sent
