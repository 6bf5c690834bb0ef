"""One simulated controller: what it says when, and how it ends."""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from agents.messages.event_stream import pack_event
from agents.running.clock import PrintClock
from agents.running.port import ABORTED, Abort, Start
from decmcts.planning.running.failing import BUS
from decmcts.print.plan import HeadActions, JointPlan
from decmcts.print.print_events import EventKind
from sim.controllers import serve
from sim.controllers.feeding import Feeding, Work
from tests.planning.replanning.conftest import Made


@pytest.fixture
def feeding(made: Made) -> Feeding:
    return Feeding(0, Work.of_plan(made.document, "left"))


def test_it_carries_out_what_is_released_and_no_more(feeding: Feeding) -> None:
    """Each action begins and ends once, in order, one behind the other."""
    feeding.release(5, 0.0)
    events = list(feeding.step(1e6))
    ended = [event.action for event in events if event.kind is EventKind.ENDED]
    assert ended == list(range(5)) and math.isinf(feeding.next_s())
    assert [event.time_s for event in events] == sorted(event.time_s for event in events)
    assert list(feeding.step(2e6)) == []


def test_it_ends_behind_the_action_it_is_at(feeding: Feeding) -> None:
    """When its agent is gone: the last word is that it is off, and where."""
    feeding.release(50, 0.0)
    first = feeding.next_s()
    list(feeding.step(first + 1e-3))
    feeding.end("its agent is gone")
    *_, ended, failed = feeding.step(1e6)
    assert (ended.kind, failed.kind) == (EventKind.ENDED, EventKind.FAILED)
    assert failed.at == ended.at and failed.what == "its agent is gone"
    assert list(feeding.step(2e6)) == []


def test_a_clog_says_where_it_stopped(made: Made, feeding: Feeding) -> None:
    """Point and place lie on the path of the action."""
    feeding.release(200, 0.0)
    k = int(np.flatnonzero(np.diff(feeding.work.first) > 3)[0])
    list(feeding.step(0.0))
    while feeding.action < k or not feeding.begun:
        list(feeding.step(feeding.next_s()))
    middle = feeding.begin_s + float(feeding.work.ends(k)[1]) + 1e-3
    list(feeding.step(middle))
    failed = feeding.fail("clogged", middle)
    path = made.document.plan.heads[0].action_path(k)
    assert (failed.action, failed.point) == (k, 2)
    a, b, at = path[2], path[3], np.array(failed.at)
    assert np.linalg.norm(at - a) + np.linalg.norm(b - at) == pytest.approx(np.linalg.norm(b - a))


def test_a_wait_costs_no_time_that_was_not_waited(feeding: Feeding) -> None:
    """What is released before it is needed begins when the last action ended."""
    feeding.release(1, 0.0)
    list(feeding.step(1e6))
    free_s = feeding.free_s
    feeding.release(2, 100.0)
    (began, *_) = feeding.step(1e6)
    assert began.time_s >= max(free_s, 100.0)


@pytest.mark.parametrize("how", ["released", "resumed"])
def test_nothing_begins_before_it_may_however_late_a_controller_is(
    feeding: Feeding, how: str
) -> None:
    """On a busy machine it hears that it may go on before it has said that the last action ended.

    It had begun at that end: before the other head was out of the way, and they touched.
    """
    feeding.release(1 if how == "released" else 2, 0.0)
    next(feeding.step(1.0))
    assert feeding.begun
    if how == "released":
        feeding.release(2, 5e5)
    else:
        feeding.pause()
        feeding.resume(5e5)
    second = [event for event in feeding.step(1e6) if event.action == 1]
    assert second[0].kind is EventKind.BEGAN and second[0].time_s >= 5e5


def test_a_head_without_actions_stays_parked(made: Made) -> None:
    """The rest of a print may leave a head nothing to do."""
    empty = HeadActions(
        "left", *(np.zeros(0, t) for t in (np.int8, np.int32, np.bool_, np.int32)),
        np.zeros(1, np.int64), np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(1, np.int64),
        *(np.zeros(0, t) for t in (np.int32, np.int32, np.int32, np.float64)),
    )  # fmt: skip
    document = replace(made.document, plan=JointPlan((empty,)))
    work = Work.of_plan(document, "left")
    feeding = Feeding(0, work)
    park = made.document.machine.heads[0].park
    assert work.at(0, 1.0) == feeding.at(5.0) == park and list(feeding.step(9.0)) == []


def test_what_agents_know_is_on_the_record(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A controller that was killed between the two let another head enter where it still stood."""
    written = list[int]()

    def write(descriptor: int, _: bytes) -> bool:
        written.append(descriptor)
        return True

    monkeypatch.setattr(serve, "write_all", write)
    PrintClock.made(tmp_path / "clock", 1.0)
    controller = serve.Controller(Namespace(clock=tmp_path / "clock", record=7))
    controller._report(b"something")
    assert written == [7, 1]


def test_a_controller_that_is_off_says_so_again_when_it_is_aborted(
    made: Made, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """And stays where it said it is, however late that comes; it goes to no park any more."""
    said = list[bytes]()
    monkeypatch.setattr(serve, "write_all", lambda _, content: said.append(content))
    PrintClock.made(tmp_path / "clock", 1.0)
    controller = serve.Controller(Namespace(clock=tmp_path / "clock", record=7))
    controller.feeding = Feeding(0, Work.of_plan(made.document, "left"))
    controller.feeding.release(1, 0.0)
    list(controller.feeding.step(1e-3))
    clogged = controller.feeding.fail("clogged", 0.5)
    for why in (BUS, ABORTED, ABORTED):
        controller._take(Abort(why))
    assert said == [pack_event(replace(clogged, what=ABORTED))] * 2  # once on its record
    controller._take(Start(1, "plan", ""))
    assert controller.number == -1 and len(said) == 2
