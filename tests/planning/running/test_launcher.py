"""What the launcher of a run hands out when heads fail, with processes that only listen."""

from __future__ import annotations

import queue
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from agents.launching.processes import AgentLine
from agents.running.heads import Recorded
from agents.running.port import ABORTED, SILENT_S, STARTS_S, Abort, Finish, Ready
from decmcts.errors import InputError
from decmcts.planning.events import Event, Note
from decmcts.planning.running import failing, launcher, renewing
from decmcts.planning.running.launcher import Launcher
from decmcts.planning.running.recorded import nearest
from decmcts.planning.running.renewing import Begin, NotRenewed, Parking, Renewed, parking_plan
from decmcts.planning.running.run import RunResult
from decmcts.planning.running.team import RunOptions, Team
from decmcts.print.machine import Point
from decmcts.print.plan import ActionKind
from decmcts.print.print_events import NO_ACTION, EventKind, PrintEvent
from tests.makers.printed import printed
from tests.planning.replanning.conftest import Made

LEFT, RIGHT = 0, 1


class Listening:
    """The processes of a head: they keep what they are told."""

    def __init__(self) -> None:
        self.sent: list[dict[str, Any]] = []
        self.agent = self
        self.is_killed = False

    def send(self, command: dict[str, Any]) -> None:
        self.sent.append(command)

    def restart(self) -> None:
        """Start no process."""

    def send_to_controller(self, command: Finish | Abort) -> None:
        """Note it; no controller is there to be off."""
        self.sent.append({"command": type(command).__name__.lower(), "why": command.why})

    def kill(self) -> None:
        """Note it."""
        self.is_killed = True


class Desk:
    """A launcher whose heads are spoken for by a test."""

    def __init__(self, made: Made, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.begun: list[Begin] = []
        monkeypatch.setattr(renewing, "renew", lambda begin, *_: self.begun.append(begin))
        self.launcher = Launcher(
            made.document, made.source, RunOptions(), folder, queue.Queue()
        )  # fmt: skip
        self.team, self.renewal = self.launcher.team, self.launcher.renewal
        self.team.processes = [Listening() for _ in self.team.heads]  # type: ignore[misc]
        self.team.clock.set_pace(1.0)
        self.team.announce(made.document, is_print=True)
        for h in (LEFT, RIGHT):
            self.says(h, Ready(0, ""))

    def says(self, head: int, said: Any) -> None:
        """Have a controller say something."""
        self.launcher.take(Recorded(head, said))

    def event(self, head: int, kind: EventKind, at: Point, what: str = "") -> None:
        """Have it tell what happened in its first action."""
        self.says(head, PrintEvent(kind, head, 10.0, 0, 0, at, what=what))

    def hold(self, *numbers: int, released: int = 1) -> None:
        """Have all agents say which plan they hold, and how much of their first is released."""
        self.launcher.step()
        for h, number in enumerate(numbers):
            count = self.sent(h, "hold")[-1].get("count", 0)
            some = 0 if number else released
            held = {"event": "held", "count": count, "number": number, "released": some}
            self.launcher.take(AgentLine(h, held))
        self.launcher.step()

    def sent(self, head: int, command: str) -> list[dict[str, Any]]:
        """Return what an agent was told with this word."""
        return [one for one in self.team.processes[head].sent if one["command"] == command]  # type: ignore[attr-defined]

    def clog(self, head: int, number: int = 0) -> None:
        """Have a head clog where it stands, or fail once more on its way to its park."""
        at = (60.0, 100.0, 1.0) if head == LEFT else (200.0, 100.0, 1.0)
        failed = PrintEvent(EventKind.FAILED, head, 10.0, NO_ACTION, 0, at, what="clogged")
        assert self.team.heads[head].number == number
        self.says(head, failed)

    def park(self) -> None:
        """Have a way to the parks found."""
        begin = self.begun[-1]
        parking = parking_plan(begin.document, begin.whole, begin.standing, begin.obstacles)
        assert parking is not None
        self.launcher.take(Parking(begin, parking))


@pytest.fixture
def desk(made: Made, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Desk:
    return Desk(made, tmp_path, monkeypatch)


def test_a_head_that_failed_is_parked_when_its_controller_says_so(made: Made, desk: Desk) -> None:
    """It had counted as parked as soon as a way was found."""
    at, park = (200.0, 100.0, 1.0), made.document.machine.heads[RIGHT].park
    desk.event(RIGHT, EventKind.FAILED, at, "clogged")
    desk.hold(0, 0)
    desk.park()
    desk.says(RIGHT, Ready(1, ""))
    desk.event(RIGHT, EventKind.BEGAN, at)
    assert desk.team.failures[0].at == at
    desk.event(RIGHT, EventKind.ENDED, park)
    assert desk.team.failures[0].at == park


def test_a_head_that_has_not_parked_yet_is_where_it_stands(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its way is planned anew when another head fails meanwhile."""
    at, beside = (200.0, 100.0, 1.0), (60.0, 100.0, 1.0)
    desk.event(RIGHT, EventKind.FAILED, at, "clogged")
    desk.hold(0, 0)
    desk.park()
    desk.event(LEFT, EventKind.FAILED, beside, "clogged")
    monkeypatch.setattr(Team, "living", lambda _: [LEFT])  # as if a third head worked
    desk.hold(0, 0)
    assert desk.begun[-1].standing["right"] == at


class Heard:
    """A witness that has heard some heads at once."""

    def __init__(self, *heads: int) -> None:
        self.heard, self.is_asked, self.is_listening = heads, False, False
        self.asked = 0

    def ask(self) -> None:
        self.asked, self.is_asked = self.asked + 1, True

    def end(self) -> None:
        self.is_asked = False


def miss_each_other(desk: Desk) -> None:
    """Have both heads say that they do not hear the other, whose process lives."""
    now = time.monotonic()
    for h in (LEFT, RIGHT):
        desk.team.heads[h].missing, desk.team.heads[h].pulse_at = (1 - h,), now


@pytest.mark.parametrize("deaf", [LEFT, RIGHT])
def test_of_two_heads_the_one_stops_that_a_witness_does_not_hear(desk: Desk, deaf: int) -> None:
    """Each accuses the other; the second had been taken, and the first went on for ever."""
    desk.team.witness = Heard(1 - deaf)  # type: ignore[assignment]
    miss_each_other(desk)
    desk.launcher.step()
    sent = [[one["command"] for one in each.sent] for each in desk.team.processes]
    assert ["abort" in commands for commands in sent] == [deaf == LEFT, deaf == RIGHT]


def listening(desk: Desk) -> Heard:
    """Return a witness that listens, as two heads have lost one another."""
    witness = Heard(LEFT)
    witness.is_listening = True
    desk.team.witness = witness  # type: ignore[assignment]
    miss_each_other(desk)
    desk.launcher.step()
    return witness


@pytest.mark.parametrize("heard", [(LEFT, RIGHT), ()])
def test_a_witness_that_tells_nothing_apart_is_asked_again(
    desk: Desk, heard: tuple[int, ...]
) -> None:
    """Heads it hears may find to one another; one that hears none may have failed itself.

    After some times one of them is stopped, so that the run goes on.
    """
    witness = Heard(*heard)
    desk.team.witness = witness  # type: ignore[assignment]
    for k in range(failing.PATIENCE + 1):
        miss_each_other(desk)
        assert not any(one["command"] == "abort" for one in desk.team.processes[RIGHT].sent)
        desk.launcher.step()
        assert witness.asked == k + 1
    assert any(one["command"] == "abort" for one in desk.team.processes[RIGHT].sent)


def test_what_a_witness_heard_before_heads_found_to_one_another_is_forgotten(desk: Desk) -> None:
    """It had counted when they lost one another once more: the head that still spoke stopped."""
    witness = listening(desk)
    assert witness.is_asked
    for head in desk.team.heads:
        head.missing = ()
    desk.launcher.step()
    assert not witness.is_asked
    witness.is_listening, witness.heard = False, (RIGHT,)  # what it hears when it is asked anew
    miss_each_other(desk)
    desk.launcher.step()
    assert witness.asked == 2
    sent = [[one["command"] for one in each.sent] for each in desk.team.processes]
    assert ["abort" in commands for commands in sent] == [True, False]


def test_a_late_pulse_does_not_have_a_witness_begin_again(desk: Desk) -> None:
    """On a busy machine none would ever come to an end."""
    witness = listening(desk)
    for head in desk.team.heads:
        head.pulse_at -= SILENT_S
    desk.launcher.step()
    assert witness.is_asked and witness.asked == 1


@pytest.mark.parametrize("goes", [False, True])
def test_a_head_that_loses_the_bus_on_its_way_to_its_park_is_lost(desk: Desk, goes: bool) -> None:
    """Nobody would hear that it has parked. It does nothing more while a person looks.

    Before it goes it only gets another agent: its controller has said where it stands.
    """
    desk.event(RIGHT, EventKind.FAILED, (200.0, 100.0, 1.0), "clogged")
    desk.launcher.step()
    assert desk.team.heads[RIGHT].parks and desk.team.lost() == []
    if goes:
        desk.hold(0, 0)
        desk.park()
        desk.says(RIGHT, Ready(1, ""))
    desk.team.witness = Heard(LEFT)  # type: ignore[assignment]
    miss_each_other(desk)
    desk.launcher.step()
    assert desk.team.lost() == [RIGHT] * goes and desk.team.heads[RIGHT].parks is not goes
    assert desk.team.processes[RIGHT].is_killed is goes and not desk.team.processes[LEFT].is_killed


def test_nothing_is_planned_while_a_head_is_lost(desk: Desk) -> None:
    """Nobody knows where it is: the others go on with what does not need it."""
    desk.event(RIGHT, EventKind.FAILED, (200.0, 100.0, 1.0), "clogged")
    desk.launcher.step()
    desk.team.heads[LEFT].controller_gone = "its controller hangs"
    desk.hold(0, 0)
    assert not desk.begun and desk.team.lost() == [LEFT]


@pytest.mark.parametrize("place", ["", "park "])
def test_a_bead_is_finished_from_where_a_person_saw_its_head_stop(
    made: Made, desk: Desk, place: str
) -> None:
    """The controller is dead and cannot say it."""
    path = _first_bead(made, desk)
    stopped = path[0] + 0.25 * (path[1] - path[0]) + [0.1, 0.0, 0.0]
    desk.launcher.asking.do(f"fenced right {place}{','.join(map(str, stopped))}".split())
    carried = desk.team.plans[0]
    state = carried.state(RIGHT)
    assert state.is_exact and state.at is not None
    assert np.linalg.norm(np.subtract(state.at, stopped)) <= 0.11
    assert 0.0 < printed(carried)[-1][1] < 1.0
    failure = desk.team.failures[0]
    park = made.document.machine.heads[RIGHT].park
    assert failure.at == (park if place else pytest.approx(stopped))


@pytest.mark.parametrize("corner", [0, 1])
def test_a_head_may_have_stopped_right_at_a_corner(made: Made, desk: Desk, corner: int) -> None:
    """No way is left behind the last point that was passed: speeds were divided by it."""
    path = _first_bead(made, desk)
    desk.launcher.asking.do(["fenced", "right", ",".join(map(str, path[corner]))])
    names = [head.name for head in desk.team.heads]
    machine, plans = made.document.machine, desk.team.plans
    for near in nearest(machine, names, plans, desk.team.moved, 100.0):
        assert np.isfinite(near.gap_mm)


def test_how_much_of_a_bead_is_printed_is_unknown_where_its_head_was_put_elsewhere(
    made: Made, desk: Desk
) -> None:
    _first_bead(made, desk)
    desk.launcher.asking.do(["fenced", "right", "park"])
    assert not desk.team.plans[0].state(RIGHT).is_exact


def _first_bead(made: Made, desk: Desk) -> NDArray[np.float64]:
    """Have the right head die in its first bead; return the bead's path."""
    actions = made.document.plan.heads[RIGHT]
    k = int(np.flatnonzero(actions.kind == ActionKind.PRINT)[0])
    path = actions.action_path(k)
    for action, kind in ((j, e) for j in range(k) for e in (EventKind.BEGAN, EventKind.ENDED)):
        at = tuple(actions.action_path(action)[-1].tolist())
        desk.says(RIGHT, PrintEvent(kind, RIGHT, 10.0, action, 0, at))
    desk.says(RIGHT, PrintEvent(EventKind.BEGAN, RIGHT, 10.0, k, 0, tuple(path[0].tolist())))
    desk.team.heads[RIGHT].controller_gone = "its controller ended"
    desk.launcher.step()
    return path


def test_a_person_is_told_where_a_place_cannot_be(made: Made, desk: Desk) -> None:
    """It was dropped in silence, and the bead's rest stayed unknown."""
    said: list[Event] = []
    desk.team.report = said.append
    path = _first_bead(made, desk)
    aside = path[0] + [0.0, 0.0, 5.0]
    desk.launcher.asking.do(["fenced", "right", ",".join(map(str, aside))])
    assert any("stays unknown" in event.text for event in said if isinstance(event, Note))
    assert not desk.team.plans[0].state(RIGHT).is_exact


# A second failure ---------------------------------------------------------


def parked(desk: Desk) -> None:
    """Have the right head clog, and a way to the parks be found; the left one still prints."""
    desk.clog(RIGHT)
    desk.hold(0, 0)
    desk.park()


def test_a_head_that_fails_before_a_plan_is_begun_has_not_begun_it(desk: Desk) -> None:
    """The left one was to go on in that plan, and would have gone beyond its share of this one."""
    parked(desk)
    desk.says(RIGHT, Ready(1, ""))
    desk.clog(RIGHT, 1)
    desk.hold(0, 1)
    assert [limit["number"] for limit in desk.sent(LEFT, "limit")] == [0, 0]
    assert desk.team.printing().number == 0


def clogged_beside_one_that_holds_the_next_plan(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> int:
    """Clog the right head in the first plan; return how far the left one had gone on in it."""
    monkeypatch.setattr(renewing, "MORE_S", -4.0)
    parked(desk)
    before = desk.team.plans[0].until[LEFT]
    desk.says(LEFT, Ready(1, ""))
    desk.clog(RIGHT)
    return before


def test_a_head_that_holds_the_next_plan_goes_on_no_further_in_this_one(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it had still been given was taken to be printed, and nobody printed it."""
    before = clogged_beside_one_that_holds_the_next_plan(desk, monkeypatch)
    assert before < len(desk.launcher.document.plan.heads[LEFT])
    desk.hold(1, 0, released=before)
    assert desk.team.plans[0].until[LEFT] == before
    assert desk.begun[-1].standing["left"] == desk.team.plans[0].stands(LEFT, before)


def test_others_do_not_count_on_what_a_head_can_do_no_more(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither where the rest cannot be planned."""
    before = clogged_beside_one_that_holds_the_next_plan(desk, monkeypatch)
    desk.hold(1, 0)
    desk.launcher.take(NotRenewed(desk.begun[-1], "for once", parked=False))
    assert desk.team.plans[0].until[LEFT] == before


def test_a_plan_that_nobody_begins_is_not_waited_for(desk: Desk) -> None:
    """The run had never ended."""
    parked(desk)
    desk.clog(RIGHT)
    desk.hold(0, 0)
    desk.launcher.take(NotRenewed(desk.begun[-1], "for once", parked=False))
    assert desk.team.last_of(LEFT).number == 0


def test_what_is_left_out_of_a_plan_that_nobody_begins_counts_once(made: Made, desk: Desk) -> None:
    """It is left out of the next one too, and was counted twice."""
    for _ in range(2):
        desk.clog(RIGHT)
        desk.hold(0, 0)
        rest = Renewed(desk.begun[-1], made.document, made.source, 3, ("3 are left",), ("one",))
        desk.launcher.take(rest)
    assert desk.renewal.left_out == 0 and not desk.renewal.left
    number = desk.team.plans[-1].number
    desk.says(LEFT, Ready(number, ""))
    desk.event(LEFT, EventKind.BEGAN, (60.0, 100.0, 1.0))
    assert desk.renewal.left_out == 3
    assert desk.renewal.left == ["3 are left"] and desk.renewal.others == ["one"]


def test_a_plan_that_nobody_began_is_not_kept(made: Made, desk: Desk) -> None:
    """Its empty events were written, and a report compared the plans before and behind it."""
    desk.clog(RIGHT)
    desk.hold(0, 0)
    rest = Renewed(desk.begun[-1], made.document, made.source, 0, ())
    desk.launcher.take(rest)
    result = RunResult(
        ("left", "right"), tuple(desk.team.plans), 0.0, 1.0, 0, 0, (), {}, (), (), (), ""
    )
    assert len(result.plans) == 2 and [carried.number for carried in result.prints] == [0]
    assert len(result.logs()) == 1


def test_what_was_said_before_heads_were_told_to_hold_once_more_is_past(desk: Desk) -> None:
    """A head may have been released more since."""
    desk.clog(RIGHT)
    for _ in range(2):
        desk.launcher.failing.fence(RIGHT, (200.0, 100.0, 1.0), "clogged")
    first, last = (desk.sent(LEFT, "hold")[k]["count"] for k in (0, -1))
    for h, count in ((LEFT, first), (RIGHT, last)):
        held = {"event": "held", "count": count, "number": 0, "released": 1}
        desk.launcher.take(AgentLine(h, held))
    desk.launcher.step()
    assert not desk.begun


def test_heads_do_all_they_can_while_one_is_lost(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They had stood where they were to stand for a plan that is not true any more."""
    monkeypatch.setattr(renewing, "MORE_S", -4.0)  # so that much more could be done
    desk.clog(RIGHT)
    desk.hold(0, 0)
    before = desk.team.plans[0].until[LEFT]
    desk.team.heads[RIGHT].controller_gone = "its controller ended"
    desk.hold(0)
    assert desk.team.lost() == [RIGHT] and not desk.renewal.is_busy
    assert np.isnan(desk.team.failures[0].fenced_s)
    assert desk.sent(LEFT, "limit")[-1]["until"] > before


def asks(desk: Desk) -> list[str]:
    """Have a launcher keep of which heads it asks a person."""
    asked = list[str]()

    def report(event: Event) -> None:
        if isinstance(event, Note) and "say `fenced" in event.text:
            asked.append(event.text.partition(":")[0])

    desk.team.report = report
    return asked


@pytest.mark.parametrize("how", ["ended", "hangs"])
@pytest.mark.parametrize("parks", [False, True])
def test_a_person_is_asked_of_a_head_that_lost_its_agent_and_its_controller(
    desk: Desk, how: str, parks: bool
) -> None:
    """Nobody was, and nobody knew what the run waited for."""
    asked, head = asks(desk), desk.team.heads[RIGHT]
    if parks:
        parked(desk)
        desk.says(RIGHT, Ready(1, ""))
    head.agent_gone = "killed"
    desk.launcher.step()
    assert not asked and desk.team.lost() == [RIGHT]
    if how == "ended":
        desk.says(RIGHT, None)
    else:
        head.heard_at -= STARTS_S + 1.0
    for _ in range(2):
        desk.launcher.step()
    assert asked == ["right"]


def test_a_controller_that_hangs_while_its_agent_cannot_say_so_is_noticed(desk: Desk) -> None:
    """Its agent waits for it to take up a plan, or hangs too."""
    asked = asks(desk)
    desk.team.heads[RIGHT].heard_at -= STARTS_S + 1.0
    desk.launcher.step()
    assert asked == ["right"] and desk.team.failures[0].why == "its controller hangs"


@pytest.mark.parametrize("gone", ["killed", ""])
def test_a_head_that_is_off_gets_another_agent_when_its_own_is_gone_or_hangs(
    desk: Desk, gone: str
) -> None:
    """Its controller does not say that it is off again: the run waited for the agent for ever."""
    asked, head = asks(desk), desk.team.heads[RIGHT]
    head.pulse_at = time.monotonic()
    desk.clog(RIGHT)
    desk.launcher.step()
    head.agent_gone, head.pulse_at = gone, head.pulse_at - (0.0 if gone else STARTS_S + 1.0)
    desk.launcher.step()
    assert head.parks and head.fenced and not head.agent_gone and not asked
    assert head.replaced == (not gone) and len(desk.sent(LEFT, "hold")) == 2
    desk.launcher.step()
    assert len(desk.sent(LEFT, "hold")) == 2


def test_another_agent_takes_a_head_to_its_park_whose_second_agent_is_lost(desk: Desk) -> None:
    """Its controller says where it stands, so nobody need look."""
    asked, head = asks(desk), desk.team.heads[RIGHT]
    parked(desk)
    desk.says(RIGHT, Ready(1, ""))
    head.agent_gone = "killed"
    desk.launcher.step()
    assert desk.team.lost() == [RIGHT]
    desk.says(RIGHT, PrintEvent(EventKind.FAILED, RIGHT, 12.0, NO_ACTION, 0, (210.0, 100.0, 1.0)))
    assert head.fenced and head.parks and not head.agent_gone and not asked
    desk.hold(0, 0)
    assert desk.begun[-1].standing["right"] == (210.0, 100.0, 1.0)


@pytest.mark.parametrize("gone", ["agent", "controller", "word"])
def test_a_head_that_has_parked_may_fail_as_it_likes(made: Made, desk: Desk, gone: str) -> None:
    """All was planned anew, though nothing had changed."""
    parked(desk)
    head, park = desk.team.heads[RIGHT], made.document.machine.heads[RIGHT].park
    desk.says(RIGHT, Ready(1, ""))
    desk.event(RIGHT, EventKind.BEGAN, (200.0, 100.0, 1.0))
    desk.event(RIGHT, EventKind.ENDED, park)
    match gone:
        case "agent":
            head.agent_gone = "killed"
        case "controller":
            head.controller_gone = "its controller ended"
        case _:
            failed = PrintEvent(EventKind.FAILED, RIGHT, 12.0, NO_ACTION, 0, park, what="silent")
            desk.says(RIGHT, failed)
    begun = desk.renewal.is_busy
    desk.launcher.step()
    assert desk.renewal.is_busy == begun and desk.team.lost() == []
    assert not desk.renewal.unplanned and not head.parks
    assert desk.sent(LEFT, "fence")[-1]["number"] == 1


def test_a_head_that_failed_while_it_was_paused_goes_to_its_park_when_it_may(desk: Desk) -> None:
    """Nobody could have it go on: all waited for it for ever. Another agent lets it stand too."""
    head = desk.team.heads[RIGHT]
    head.paused, head.agent_gone = True, "killed"
    desk.clog(RIGHT)
    assert head.parks and desk.sent(RIGHT, "pause")
    desk.launcher.asking.do(["resume"])
    assert desk.sent(RIGHT, "resume") and desk.sent(LEFT, "resume")
    desk.launcher.asking.do(["abort", "right"])
    assert desk.sent(RIGHT, "abort")


# The end of standard input -------------------------------------------------


def nobody_asks(desk: Desk, monkeypatch: pytest.MonkeyPatch, *lines: str) -> list[str]:
    """Have people say their last, and let no event be waited for; return what is reported."""
    said = list[str]()
    desk.team.report = lambda event: said.append(event.text)
    for line in (*lines, None):
        desk.launcher.asked.put(line)
    monkeypatch.setattr(launcher, "QUIET_S", -1.0)
    desk.launcher.step()
    return said


def waits(desk: Desk, head: int, *, of: int | None) -> None:
    """Have an agent say for whom its head stands."""
    stands = {"event": "stands", "waits_for": of, "missing": []}
    desk.launcher.take(AgentLine(head, stands))


@pytest.mark.parametrize("whom", ["", " right"])
def test_a_run_ends_whose_heads_nobody_can_resume(
    desk: Desk, monkeypatch: pytest.MonkeyPatch, whom: str
) -> None:
    """It waited for ever, and said nothing. What needs nothing of them is done before."""
    said = nobody_asks(desk, monkeypatch, f"pause{whom}")
    assert len(said) == 1 and f"resume {whom.strip() or 'left, right'}" in said[0]
    desk.event(LEFT, EventKind.BEGAN, (60.0, 100.0, 1.0))
    assert not desk.launcher.is_over()
    desk.event(LEFT, EventKind.ENDED, (60.0, 100.0, 1.0))
    assert desk.launcher.is_over() is (not whom)  # it may go on
    waits(desk, LEFT, of=RIGHT)
    assert desk.launcher.is_over()


def test_a_head_on_its_way_to_its_park_may_be_paused_when_standard_input_ends(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The rest would begin once it has parked."""
    nobody_asks(desk, monkeypatch, "pause right")
    parked(desk)
    waits(desk, LEFT, of=RIGHT)
    assert desk.launcher.is_over() is False  # the rest is planned
    desk.launcher.take(NotRenewed(desk.begun[-1], "for once", parked=True))
    assert desk.launcher.is_over()


def test_heads_that_were_told_to_go_on_are_waited_for(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert not nobody_asks(desk, monkeypatch, "pause", "resume")
    for h in (LEFT, RIGHT):
        waits(desk, h, of=1 - h)
    assert not desk.launcher.is_over()


def test_long_beads_are_ended_where_nobody_is_asked_of_a_lost_head(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Behind two seconds without an event the run ended, though much could still be printed."""
    desk.team.heads[RIGHT].controller_gone = "its controller ended"
    desk.hold(0)
    assert desk.team.lost() == [RIGHT]
    nobody_asks(desk, monkeypatch)
    desk.event(LEFT, EventKind.BEGAN, (60.0, 100.0, 1.0))
    assert not desk.launcher.is_over()
    desk.event(LEFT, EventKind.ENDED, (60.0, 100.0, 1.0))
    assert not desk.launcher.is_over()  # it goes on
    waits(desk, LEFT, of=RIGHT)
    assert desk.launcher.is_over()


def test_a_head_that_hears_nothing_is_not_asked_in_silence(desk: Desk) -> None:
    """A person took it to be paused."""
    for word in ("pause", "abort"):
        desk.launcher.asking.do([word, "right"])
    desk.event(RIGHT, EventKind.FAILED, (200.0, 100.0, 1.0), ABORTED)
    for word in ("pause", "abort"):
        with pytest.raises(InputError, match="right is off"):
            desk.launcher.asking.do([word, "right"])


def test_a_head_whose_agent_is_lost_obeys_a_person_all_the_same(desk: Desk) -> None:
    """Another agent took it to its park, where a person's hands were."""
    desk.team.heads[RIGHT].agent_gone = "killed"
    desk.launcher.step()
    assert desk.team.lost() == [RIGHT]
    desk.launcher.asking.do(["pause"])
    desk.event(RIGHT, EventKind.FAILED, (200.0, 100.0, 1.0), "its agent is gone")
    assert desk.team.heads[RIGHT].parks and desk.sent(RIGHT, "pause")
    desk.launcher.asking.do(["abort", "right"])
    assert desk.sent(RIGHT, "abort")


def test_a_head_that_clogged_and_is_aborted_stays_where_it_is(desk: Desk) -> None:
    """It went to its park: its controller was off already, and did not listen."""
    desk.clog(RIGHT)
    assert desk.team.heads[RIGHT].parks
    desk.event(RIGHT, EventKind.FAILED, (200.0, 100.0, 1.0), ABORTED)
    assert not desk.team.heads[RIGHT].parks and desk.team.processes[RIGHT].is_killed
    assert len(desk.team.plans[0].events) == 1  # a stream with two of them is refused


def test_a_head_that_is_aborted_at_its_park_changes_nothing(made: Made, desk: Desk) -> None:
    parked(desk)
    park = made.document.machine.heads[RIGHT].park
    desk.says(RIGHT, Ready(1, ""))
    desk.event(RIGHT, EventKind.BEGAN, (200.0, 100.0, 1.0))
    desk.event(RIGHT, EventKind.ENDED, park)
    desk.says(RIGHT, PrintEvent(EventKind.FAILED, RIGHT, 12.0, NO_ACTION, 0, park, what=ABORTED))
    assert desk.team.processes[RIGHT].is_killed and not desk.renewal.unplanned


def test_who_did_not_start_is_named_with_why(desk: Desk) -> None:
    """Others were named, which had not come so far yet, or nobody."""
    desk.team.heads[RIGHT].agent_gone = "killed by SIGKILL"
    desk.team.heads[LEFT].number = -1
    with pytest.raises(InputError, match=r"of right \(killed by SIGKILL\) did not start"):
        desk.launcher._start()
