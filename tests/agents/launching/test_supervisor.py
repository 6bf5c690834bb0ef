"""The launcher's judgement: whom to fence, and when a plan counts."""

from __future__ import annotations

import queue
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from agents.launching import supervisor as supervisors
from agents.launching.liveness import (
    AGREE_LIMIT_S,
    HUNG_S,
    LATE_LIMIT_S,
    MEET_S,
    MOST_MOVES,
    RETURN_S,
    START_LIMIT_S,
)
from agents.launching.processes import AgentLine
from agents.launching.status import AgentStatus, LaunchError
from agents.launching.supervisor import Supervisor
from decmcts.search.sequence.stopping import Stopping

PROGRESS = {
    "event": "progress",
    "phase": "planning",
    "live": [0, 1],
    "rounds": 3,
    "best_makespan_s": 9.0,
    "elapsed_s": 1.0,
    "agreeing_s": None,
    "stuck": False,
    "entropy": 1.0,
    "traffic": {},
}


class FakeChild:
    """Keeps what was done to an agent's process."""

    def __init__(self) -> None:
        self.sent: list[dict[str, Any]] = []
        self.killed = False
        self.words = ""
        self.fell = False

    def send(self, command: dict[str, Any]) -> None:
        self.sent.append(command)

    def kill(self) -> None:
        self.killed = True

    def ending(self) -> str:
        return self.words

    def died(self) -> bool:
        return self.fell


class Scene:
    """A supervisor over fake agents whose lines are known beforehand.

    All have a pulse, but those that are `hushed` from some time until another.
    """

    def __init__(self, heads: int = 2, step_s: float = 0.5) -> None:
        self.children = {head: FakeChild() for head in range(heads)}
        self.names = tuple(f"head {head}" for head in range(heads))
        self.heard: queue.Queue[AgentLine] = queue.Queue()
        self.now, self.step_s = 0.0, step_s
        self.due: list[tuple[float, AgentLine]] = []  # when, what
        self.seen: list[tuple[AgentStatus, ...]] = []
        self.hushed: dict[int, tuple[float, float]] = {}
        self.moves: list[float] = []
        self.limit_s = 5.0
        self.begun_again: list[tuple[int, int, float]] = []  # head, epoch, seconds to plan

    def elsewhere(self) -> list[str]:
        self.moves.append(self.now)
        return [f"place {len(self.moves)}" for _ in self.names]

    def start_again(
        self, head: int, epoch: int, left_s: float, places: Sequence[str] | None
    ) -> None:
        self.children[head] = FakeChild()
        self.begun_again.append((head, epoch, left_s))

    def pulse(self) -> None:
        for head in self.children:
            since, until = self.hushed.get(head, (0.0, 0.0))
            if not since <= self.now < until:
                self.heard.put(AgentLine(head, {"event": "pulse"}))

    def says(self, head: int, line: dict[str, Any] | None, *, at: float = 0.0) -> None:
        if at > self.now:
            self.due.append((at, AgentLine(head, line)))
        else:
            self.heard.put(AgentLine(head, line))

    def keeps_saying(self, head: int, line: dict[str, Any], *, since: float, until: float) -> None:
        for at in np.arange(since, until, 0.5).tolist():
            self.says(head, line, at=at)

    def released(self, head: int, digest: str, *, at: float = 0.0) -> None:
        self.says(head, {"event": "released", "digest": digest}, at=at)

    def run(self, asked: Callable[[], bool] | None = None) -> dict[str, Any]:
        def clock() -> float:
            if self.heard.empty():
                self.now += self.step_s
                for _, said in (due for due in self.due if due[0] <= self.now):
                    self.heard.put(said)
                self.due = [due for due in self.due if due[0] > self.now]
                self.pulse()
            return self.now

        supervisor = Supervisor(
            self.children,
            self.names,
            self.heard,
            stopping=Stopping(self.limit_s, asked=asked),
            epoch=7,
            on_progress=self.seen.append,
            elsewhere=self.elsewhere,
            start_again=self.start_again,
            clock=clock,
        )
        self.supervisor = supervisor
        return supervisor.run()


@pytest.fixture(autouse=True)
def _wait_for_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(supervisors, "_POLL_S", 0.0)


@pytest.fixture
def scene() -> Scene:
    made = Scene()
    for head in (0, 1):
        made.says(head, {"event": "ready"})
        made.says(head, PROGRESS)
    return made


def test_a_plan_counts_when_all_released_it(scene: Scene) -> None:
    """One agent's word is not an agreement."""
    scene.released(0, "aa")
    scene.released(1, "aa")
    assert scene.run()["digest"] == "aa"
    assert not any(child.killed for child in scene.children.values())
    assert scene.seen[3][1].history == ((1.0, 9.0),)


def agreeing(*live: int) -> dict[str, Any]:
    return {**PROGRESS, "phase": "agreeing", "live": list(live)}


def team(heads: int) -> Scene:
    """All plan together, then some end planning; time passes by tenths of seconds."""
    made = Scene(heads, step_s=0.1)
    for head in range(heads):
        made.says(head, {"event": "ready"})
        made.says(head, {**PROGRESS, "live": list(range(heads))})
    return made


def test_an_unreachable_agent_is_killed_before_the_others_hear_that_it_is_off() -> None:
    """Told the other way round, they would release while it still moves."""
    scene = team(2)
    scene.says(0, {"event": "unfenced", "heads": [1]})
    scene.keeps_saying(0, agreeing(0), since=0.5, until=6.0)
    order: list[str] = []
    scene.children[1].kill = lambda: order.append("killed")  # type: ignore[method-assign]
    scene.children[0].send = lambda command: order.append(str(command))  # type: ignore[method-assign]
    scene.released(0, "bb", at=6.0)
    assert scene.run()["digest"] == "bb"
    assert order == ["killed", "{'command': 'fence', 'head': 1, 'epoch': 7}"]


@pytest.mark.parametrize("sent", [(0, 1, 2), (0, 2)])
def test_one_that_hears_nobody_does_not_end_the_others(sent: tuple[int, ...]) -> None:
    """It agrees with itself at once and says so first; the others were killed for it."""
    scene = team(3)
    scene.says(1, {"event": "unfenced", "heads": [0, 2]})
    for head, live in ((0, sent), (1, (1,)), (2, sent)):
        scene.keeps_saying(head, agreeing(*live), since=0.5, until=6.0)
    for head in (0, 2):
        scene.released(head, "bb", at=6.0)
    assert scene.run()["digest"] == "bb"
    assert [scene.children[head].killed for head in range(3)] == [False, True, False]


def test_one_that_has_the_others_back_ends_nobody() -> None:
    """It stood still, lost all links at once, and was greeted again a moment later."""
    scene = team(3)
    scene.says(1, {"event": "unfenced", "heads": [0, 2]})
    for head in range(3):
        scene.keeps_saying(head, agreeing(0, 1, 2), since=1.0, until=6.0)
        scene.released(head, "bb", at=6.0)
    assert scene.run()["digest"] == "bb"
    assert not any(child.killed for child in scene.children.values())


def test_one_that_is_left_over_ends_all_that_are_hung() -> None:
    """They were the larger group; but they say nothing any more."""
    scene = team(3)
    scene.hushed = dict.fromkeys((0, 1), (0.5, 99.0))
    scene.says(2, {"event": "unfenced", "heads": [0, 1]}, at=3.0)
    scene.keeps_saying(2, agreeing(2), since=0.5, until=9.0)
    scene.released(2, "bb", at=9.0)
    assert scene.run()["digest"] == "bb"
    assert [scene.children[head].killed for head in range(3)] == [True, True, False]


def test_a_hung_head_does_not_win_by_its_number() -> None:
    """The lowest head's side goes on only where both speak."""
    scene = team(2)
    scene.hushed[0] = (11.0, 99.0)
    scene.keeps_saying(1, agreeing(1), since=11.5, until=21.0)
    scene.says(1, {"event": "unfenced", "heads": [0]}, at=12.0)
    scene.released(1, "bb", at=21.0)
    assert scene.run()["digest"] == "bb"
    assert [scene.children[head].killed for head in range(2)] == [True, False]
    assert "said nothing for 8 s" in scene.supervisor.status[0].note


@pytest.mark.parametrize("pause_s", [1.5, 5.0, 7.0])
@pytest.mark.parametrize("since", [1.0, 4.0, 5.0])
def test_a_head_that_pauses_is_waited_for(since: float, pause_s: float) -> None:
    """Stopped and continued, each hears only itself for a moment: both were given up."""
    scene = team(2)
    over = since + pause_s
    scene.hushed[0] = (since, over)
    alone = {**agreeing(1), "stuck": True}
    scene.keeps_saying(1, alone, since=since + 1.0, until=over + 1.0)
    scene.says(1, {"event": "unfenced", "heads": [0]}, at=since + 1.5)
    scene.says(0, {**agreeing(0), "stuck": True}, at=over + 0.1)
    for head in (0, 1):
        scene.says(head, agreeing(0, 1), at=over + 1.5)
        scene.released(head, "aa", at=over + 2.0)
    assert scene.run()["digest"] == "aa"
    assert not any(child.killed for child in scene.children.values())


@pytest.mark.parametrize("limit_s", [0.0, 5.0])
def test_agents_that_are_all_stopped_are_not_waited_for(limit_s: float) -> None:
    """A launch of 8 s took 163: nobody was there to say that anybody was missed."""
    scene = team(2)
    scene.hushed = dict.fromkeys((0, 1), (3.0, 999.0))
    scene.limit_s = limit_s
    with pytest.raises(LaunchError, match="every agent ended: it said nothing for 8 s"):
        scene.run()
    assert scene.now < max(limit_s, 3.0 + HUNG_S) + 2.0


def test_an_agent_that_only_lives_is_not_waited_for() -> None:
    """Its planner is stuck: it has a pulse, and its network lives. A launch of 8 s took 140."""
    scene = team(2)
    scene.keeps_saying(0, agreeing(0, 1), since=5.0, until=30.0)
    scene.released(0, "bb", at=5.0 + AGREE_LIMIT_S + 1.0)
    assert scene.run()["digest"] == "bb"
    assert [scene.children[head].killed for head in range(2)] == [False, True]


def test_agents_that_miss_each_other_meet_elsewhere() -> None:
    """A socket was removed, a port was taken: both live, and one was given up."""
    scene = team(2)
    for head in (0, 1):
        scene.keeps_saying(head, {**PROGRESS, "live": [head]}, since=1.0, until=6.0)
        scene.says(head, PROGRESS, at=7.0)
        scene.released(head, "aa", at=9.0)
    assert scene.run()["digest"] == "aa"
    assert len(scene.moves) == 1 and scene.moves[0] <= 1.0 + MEET_S + 1.0
    meet = {"command": "meet", "places": ["place 1", "place 1"]}
    assert all(child.sent == [meet] for child in scene.children.values())


def test_a_place_that_cannot_be_opened_is_left_at_once() -> None:
    """Somebody took the port before the agent listened there."""
    scene = team(2)
    scene.says(1, {"event": "shut", "reason": "cannot listen"})
    scene.says(0, {"event": "shut", "reason": "cannot listen"})
    for head in (0, 1):
        scene.released(head, "aa", at=2.0)
    assert scene.run()["digest"] == "aa"
    assert scene.moves == [0.0]


def test_places_are_not_changed_for_ever() -> None:
    """Where nothing helps, one side is given up in time."""
    scene = team(2)
    for head in (0, 1):
        scene.keeps_saying(head, agreeing(head), since=5.0, until=40.0)
    scene.released(0, "bb", at=16.0)
    assert scene.run()["digest"] == "bb"
    assert len(scene.moves) <= MOST_MOVES
    assert [scene.children[head].killed for head in range(2)] == [False, True]


def test_an_agent_that_hangs_after_it_missed_another_ends_nobody() -> None:
    """Its word stands, but it is the one that is lost."""
    scene = team(2)
    scene.says(0, {"event": "unfenced", "heads": [1]})
    scene.hushed[0] = (0.5, 99.0)
    scene.keeps_saying(1, agreeing(1), since=0.5, until=9.0)
    scene.says(1, {"event": "unfenced", "heads": [0]}, at=3.0)
    scene.released(1, "bb", at=9.0)
    assert scene.run()["digest"] == "bb"
    assert [scene.children[head].killed for head in range(2)] == [True, False]


def test_of_two_that_cannot_hear_each_other_beside_a_third_one_is_ended() -> None:
    """Both would wait for ever for a plan of all three."""
    scene = team(3)
    for head, live in ((0, (0, 2)), (1, (1, 2)), (2, (0, 1, 2))):
        if missing := sorted({0, 1, 2} - set(live)):
            scene.says(head, {"event": "unfenced", "heads": missing})
        scene.keeps_saying(head, agreeing(*live), since=0.5, until=6.0)
    for head in (0, 2):
        scene.released(head, "bb", at=6.0)
    assert scene.run()["digest"] == "bb"
    assert [scene.children[head].killed for head in range(3)] == [False, True, False]


def test_a_fence_is_said_again_to_who_misses_the_head(scene: Scene) -> None:
    """An agent that lost the first word would wait until the launch is given up."""
    scene.says(1, None)
    scene.says(0, {"event": "unfenced", "heads": [1]})
    scene.released(0, "bb")
    scene.run()
    fence = {"command": "fence", "head": 1, "epoch": 7}
    assert scene.children[0].sent == [fence, fence]


def test_what_a_fenced_agent_released_is_void(scene: Scene) -> None:
    """The others may have agreed on another plan since."""
    scene.released(1, "aa")
    scene.says(1, None)
    scene.released(0, "bb")
    assert scene.run()["digest"] == "bb"


def test_a_refusal_ends_the_launch_with_its_reason(scene: Scene) -> None:
    """Two problems in one launch is a fault no waiting heals."""
    scene.says(0, {"event": "refused", "head": 1, "reason": "right holds problem cd"})
    with pytest.raises(LaunchError, match="right holds problem cd"):
        scene.run()


def test_no_agent_left_says_why(scene: Scene) -> None:
    """The last words of the dead are what the user needs."""
    scene.children[0].words = "no such port"
    scene.says(0, None)
    scene.says(1, None)
    with pytest.raises(LaunchError, match="every agent ended: no such port; its process"):
        scene.run()


def test_heads_that_cannot_print_it_all_end_the_launch(scene: Scene) -> None:
    """Waiting for a dead head would be for ever."""
    scene.says(1, None)
    scene.says(0, {"event": "note", "text": "no head can print contour 7"})
    scene.says(0, {**PROGRESS, "stuck": True})
    with pytest.raises(LaunchError, match="cannot print this: no head can print contour 7"):
        scene.run()


def test_the_second_interrupt_goes_to_whoever_launched(scene: Scene) -> None:
    """The first asks for the best so far; the second wants out, not one head's plan instead."""
    asked: list[bool] = []

    def interrupted() -> bool:
        if scene.now < 2.0:
            return False
        asked.append(True)
        if len(asked) == 2:
            raise KeyboardInterrupt  # as a handler does, wherever the supervisor is
        return True

    with pytest.raises(KeyboardInterrupt):
        scene.run(asked=interrupted)
    assert scene.children[0].sent == [{"command": "stop"}]


@pytest.mark.parametrize(
    "said", [[], [{"event": "ready"}], [{"event": "ready"}, {**PROGRESS, "live": [0], "rounds": 0}]]
)
def test_a_stop_before_the_agents_met_is_said_to_be_one(said: list[dict[str, Any]]) -> None:
    """Told to agree, each would take the other for lost: a false alarm about a head."""
    scene = Scene()
    for line in said:
        scene.says(0, line)
    scene.says(1, {"event": "ready"})
    scene.says(1, PROGRESS)
    with pytest.raises(LaunchError, match="stopped before the agents had found one another"):
        scene.run(asked=lambda: scene.now > 2.0)
    assert not any(child.killed or child.sent for child in scene.children.values())


@pytest.mark.parametrize("ready", [(), (0,)])
def test_an_agent_that_is_stopped_as_it_starts_is_not_waited_for(ready: tuple[int, ...]) -> None:
    """Before its first word nobody knew that it ran; it was waited for as if it loaded."""
    scene = Scene()
    scene.hushed = {head: (-1.0, 999.0) for head in (0, 1) if head not in ready}
    for head in ready:
        scene.says(head, {"event": "ready"})
        waits = {**PROGRESS, "live": [head], "rounds": 0}
        scene.keeps_saying(head, waits, since=1.0, until=12.0)
        scene.released(head, "aa", at=12.0)
    if ready:
        assert scene.run()["digest"] == "aa"
    else:
        with pytest.raises(LaunchError, match="every agent ended: it never said anything"):
            scene.run()
    assert scene.now < 35.0


@pytest.mark.slow
def test_an_agent_that_never_gets_ready_is_fenced() -> None:
    """A process that hangs while loading must not hang the launch."""
    scene = Scene()
    scene.says(0, {"event": "ready"})
    with pytest.raises(LaunchError):
        scene.run()  # nor does the other agree with anyone
    assert scene.children[1].killed
    assert scene.now > START_LIMIT_S + 5.0 + AGREE_LIMIT_S
    assert f"not ready after {START_LIMIT_S:g} s" in scene.supervisor.status[1].note


def test_agents_that_do_not_agree_in_time_are_fenced(scene: Scene) -> None:
    """So that a launch ends, though all speak and hear each other."""
    for head in (0, 1):
        scene.keeps_saying(head, agreeing(0, 1), since=5.0, until=40.0)
    with pytest.raises(LaunchError, match="every agent ended: no agreement 10 s"):
        scene.run()
    assert 15.0 <= scene.now <= 5.0 + AGREE_LIMIT_S + 2.0


def test_rounds_that_never_end_are_not_waited_for(scene: Scene) -> None:
    """The last resort: all live, and none says that its planning ended."""
    with pytest.raises(LaunchError, match="every agent ended: not done 120 s"):
        scene.run()
    assert scene.now < 5.0 + LATE_LIMIT_S + 2.0


def test_long_rounds_are_given_time() -> None:
    """A large print is resolved as slowly as it is planned."""
    scene = team(2)
    for head in (0, 1):
        for at in (3.0, 6.0, 9.0):
            scene.says(head, PROGRESS, at=at)
        scene.says(head, agreeing(0, 1), at=9.5)
        scene.released(head, "aa", at=9.5 + AGREE_LIMIT_S + 8.0)
    assert scene.run()["digest"] == "aa"


def test_an_agent_that_is_stopped_just_before_its_release_is_not_waited_for(scene: Scene) -> None:
    """The others released what it agreed to; the launch waited two minutes for its word."""
    scene.released(0, "aa")
    assert scene.run()["digest"] == "aa"
    assert scene.children[1].killed
    assert scene.now < AGREE_LIMIT_S


@pytest.mark.slow
def test_a_stop_is_asked_for_once(scene: Scene) -> None:
    """Asked again and again, agents would be flooded."""
    scene.released(0, "aa")
    scene.released(1, "aa", at=4.0)
    scene.run(asked=lambda: scene.now > 2.0)
    assert scene.children[0].sent.count({"command": "stop"}) == 1


# Who is started again ---------------------------------------------------------


def dies(scene: Scene, head: int, *, at: float) -> None:
    scene.children[head].fell, scene.children[head].words = True, "killed by SIGKILL"
    scene.says(head, None, at=at)


def test_an_agent_that_dies_is_started_again_and_waited_for(scene: Scene) -> None:
    """It loads for seconds, and with its head a print may take half the time."""
    dies(scene, 1, at=2.0)
    scene.says(0, {**PROGRESS, "phase": "agreeing", "live": [0]}, at=5.0)
    scene.says(1, {"event": "ready"}, at=17.0)
    for head in (0, 1):
        scene.keeps_saying(head, {**PROGRESS, "phase": "agreeing"}, since=18.0, until=21.0)
        scene.released(head, "aa", at=21.0)
    assert scene.run()["digest"] == "aa"
    ((head, epoch, left_s),) = scene.begun_again
    assert (head, epoch) == (1, 8) and 2.0 <= left_s <= 4.5
    assert scene.supervisor.fenced == set() and scene.children[0].sent == []
    assert scene.supervisor.status[1].again == "killed by SIGKILL"


def test_a_successor_that_is_not_ready_in_time_is_given_up(scene: Scene) -> None:
    """The others have a plan without it."""
    dies(scene, 1, at=2.0)
    scene.says(0, {**PROGRESS, "phase": "agreeing", "live": [0]}, at=5.0)
    scene.released(0, "aa", at=5.0 + RETURN_S + 1.0)
    assert scene.run()["digest"] == "aa"
    assert scene.children[1].killed
    assert scene.supervisor.status[1].note == "killed by SIGKILL, and not back in time"
    assert [c["epoch"] for c in scene.children[0].sent if c["command"] == "fence"] == [8]


def test_an_agent_is_not_started_a_third_time(scene: Scene) -> None:
    """What kills it twice would kill it again."""
    scene.limit_s = 30.0
    dies(scene, 1, at=2.0)
    scene.says(1, {"event": "ready"}, at=4.0)
    scene.says(1, None, at=6.0)  # died or not: it had its second life
    scene.released(0, "aa", at=8.0)
    assert scene.run()["digest"] == "aa"
    assert len(scene.begun_again) == 1 and scene.supervisor.fenced == {1}
    epochs = [c["epoch"] for c in scene.children[0].sent if c["command"] == "fence"]
    assert epochs == [8]


def test_an_agent_that_left_or_refused_its_input_is_not_started_again(scene: Scene) -> None:
    """It would do the same again."""
    scene.says(1, None, at=2.0)
    scene.released(0, "aa", at=4.0)
    assert scene.run()["digest"] == "aa"
    assert scene.begun_again == []


def test_an_agent_that_dies_before_all_met_is_waited_for() -> None:
    """Nobody plans yet: no head needs to be given up, and none may be fenced."""
    scene = Scene()
    scene.says(0, {"event": "ready"})
    dies(scene, 1, at=1.0)
    scene.says(1, {"event": "ready"}, at=6.0)
    for head in (0, 1):
        scene.says(head, PROGRESS, at=7.0)
        scene.released(head, "aa", at=8.0)
    assert scene.run()["digest"] == "aa"
    assert scene.begun_again == [(1, 8, 5.0)] and scene.supervisor.fenced == set()
    assert not any(c["command"] == "fence" for c in scene.children[0].sent)


def test_a_successor_learns_who_is_fenced_and_where_all_met(scene: Scene) -> None:
    """It would wait for the dead head for ever."""
    scene = Scene(3)
    scene.limit_s = 30.0
    for head in range(3):
        scene.says(head, {"event": "ready"})
        scene.says(head, {**PROGRESS, "live": [0, 1, 2]})
    scene.says(2, None, at=1.5)  # left
    dies(scene, 1, at=2.5)
    scene.says(1, {"event": "ready"}, at=4.0)
    for head in (0, 1):
        scene.keeps_saying(head, PROGRESS, since=3.0 + head, until=9.0)
        scene.released(head, "aa", at=9.0)
    scene.run()
    assert scene.children[1].sent == [{"command": "fence", "head": 2, "epoch": 7}]


def test_successors_of_all_are_waited_for(scene: Scene) -> None:
    """No agent is left for a moment: that is not the end of the launch."""
    scene.limit_s = 30.0
    for head in (0, 1):
        dies(scene, head, at=2.0)
        scene.says(head, {"event": "ready"}, at=6.0 + head)
        scene.keeps_saying(head, PROGRESS, since=7.5, until=12.0)
        scene.released(head, "aa", at=12.0)
    assert scene.run()["digest"] == "aa"


def test_a_successor_that_never_says_anything_is_given_up() -> None:
    """Nothing else would end the launch where all died."""
    scene = Scene(1)
    scene.limit_s = 100.0
    scene.says(0, {"event": "ready"})
    scene.says(0, {**PROGRESS, "live": [0]})
    dies(scene, 0, at=2.0)
    scene.hushed[0] = (2.0, 1e9)
    with pytest.raises(LaunchError, match="every agent ended: it never said anything"):
        scene.run()
    assert scene.now < 30.0
