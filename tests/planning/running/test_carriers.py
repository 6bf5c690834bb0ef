"""Heads that carry a plan out together: in any weather, and where one of them fails."""

from __future__ import annotations

import numpy as np
import pytest

from agents.networks.memory import MemoryNetwork, MemoryTransport, Weather
from agents.networks.transport import Packet
from agents.running.carrier import Carrier, NumberedPlan, committed
from agents.running.port import Pause, Ready, ReleaseActions, Resume, Start
from agents.running.report import KIND, NOTHING, HeadReport, Reached, unpack_report
from decmcts.print.plan import JointPlan, PlanDocument
from decmcts.print.print_events import EventKind, PrintEvent
from sim.controllers.feeding import Feeding, Work
from tests.planning.replanning.conftest import Made

STEP_S = 0.05
DIGEST = "0" * 32


class Together:
    """Carriers and controllers of all heads of a plan, on a network in memory."""

    def __init__(self, document: PlanDocument, weather: Weather, seed: int = 0) -> None:
        n = len(document.plan.heads)
        self.network = MemoryNetwork(np.random.default_rng(seed), weather)
        self.bus = [MemoryTransport(self.network, h).__enter__() for h in range(n)]
        self.plan = NumberedPlan(0, "plan", DIGEST, document.plan, tuple(range(n)))
        self.carriers = [Carrier(h, ahead_s=5.0) for h in range(n)]
        self.work = [Work.of_plan(document, head.head) for head in document.plan.heads]
        self.feeds: list[Feeding | None] = [None] * n
        self.events: list[PrintEvent] = []
        self.dead = set[int]()
        for carrier in self.carriers:
            carrier.take_plan(self.plan)

    def step(self) -> None:
        """Let a little time pass."""
        self.network.advance(STEP_S)
        now_s = self.network.now
        for h, carrier in enumerate(self.carriers):
            for arrival in self.bus[h].receive(0.0):
                if isinstance(arrival, Packet):
                    carrier.take_report(unpack_report(arrival.head, arrival.payload))
            if h in self.dead:
                continue
            for command in carrier.step(now_s):
                self._obey(h, command, now_s)
            feed = self.feeds[h]
            for event in () if feed is None else feed.step(now_s):
                self.events.append(event)
                carrier.take_statement(event)
            self.bus[h].send(KIND, carrier.report().pack(), reliable=False)

    def _obey(self, h: int, command: object, now_s: float) -> None:
        feed = self.feeds[h]
        match command:
            case Start(number, _, digest):
                self.feeds[h] = Feeding(h, self.work[h], now_s)
                self.carriers[h].take_statement(Ready(number, digest))
            case ReleaseActions(_, until) if feed is not None:
                feed.release(until, now_s)
            case Pause() if feed is not None:
                feed.pause()
            case Resume() if feed is not None:
                feed.resume(now_s)

    def run(self, most_s: float) -> None:
        """Let time pass until all heads that live have done all, or for so long."""
        while self.network.now < most_s and not all(
            c.done for h, c in enumerate(self.carriers) if h not in self.dead
        ):
            self.step()


def assert_in_order(document: PlanDocument, events: list[PrintEvent]) -> None:
    """No action begins before what it waits for has happened."""
    passed: dict[tuple[int, int], list[tuple[int, float]]] = {}
    for event in events:
        if event.kind is not EventKind.BEGAN:
            point = -1 if event.kind is EventKind.ENDED else event.point
            passed.setdefault((event.head, event.action), []).append((point, event.time_s))
    for event in events:
        if event.kind is EventKind.BEGAN:
            for edge in document.plan.heads[event.head].after_edges(event.action):
                times = [t for point, t in passed.get((edge.head, edge.action), [])
                         if point == -1 or 0 <= edge.point <= point]  # fmt: skip
                assert times and min(times) + edge.lag_s <= event.time_s + 1e-9


def test_in_fair_weather_a_plan_takes_as_long_as_planned(made: Made) -> None:
    """The controllers' times are those of `simulate`; waits cost what the network does."""
    together = Together(made.document, Weather())
    together.run(600.0)
    assert all(carrier.done for carrier in together.carriers)
    ended = max(event.time_s for event in together.events)
    planned_s = made.document.plan.makespan_s
    waits = sum(len(head.after_head) for head in made.document.plan.heads)
    assert planned_s - 0.5 <= ended <= planned_s + 2.0 * STEP_S * waits + 1.0
    assert_in_order(made.document, together.events)


@pytest.mark.parametrize("seed", range(5))
def test_in_a_storm_nothing_suffers_but_time(made: Made, seed: int) -> None:
    """Messages are lost, late, doubled and overtake each other; the order holds all the same."""
    weather = Weather(loss=0.4, delay_s=(0.0, 2.0), duplicate=0.3)
    together = Together(made.document, weather, seed)
    together.run(1200.0)
    assert all(carrier.done for carrier in together.carriers)
    assert_in_order(made.document, together.events)


def waiting(document: PlanDocument) -> tuple[int, int]:
    """Return a head that waits for another, and its first action that does."""
    for h, head in enumerate(document.plan.heads):
        for k in range(len(head)):
            if any(edge.head != h for edge in head.after_edges(k)):
                return h, k
    raise AssertionError("nobody waits")


def test_nothing_begins_that_waits_for_a_dead_head(made: Made) -> None:
    """What a dead head has not done never happens, so the space it may be in stays reserved."""
    h, k = waiting(made.document)
    together = Together(made.document, Weather())
    together.dead = {1 - h}
    together.carriers[h].take_report(together.carriers[1 - h].report())
    for _ in range(4000):
        together.step()
    assert not together.events  # no head begins what the other does not hold
    together.dead = set()
    while together.carriers[1 - h].reached == NOTHING:
        together.step()
    together.dead = {1 - h}
    for _ in range(4000):
        together.step()
    assert together.carriers[h].reached.ended <= k
    assert_in_order(made.document, together.events)


def test_heads_that_hold_other_plans_begin_nothing(made: Made) -> None:
    """All living heads must have said the same digest."""
    together = Together(made.document, Weather())
    other = NumberedPlan(0, "plan", "1" * 32, made.document.plan, (0, 1))
    together.carriers[1].take_plan(other)
    for _ in range(400):
        together.step()
    assert not together.events and together.carriers[0].waits_for() == 1


def test_a_head_that_failed_before_it_said_what_it_holds_is_not_waited_for(made: Made) -> None:
    """It never says it any more: the others waited for ever, with what needs nothing of it."""
    together = Together(made.document, Weather())
    together.dead = {1}
    together.carriers[0].fence(1, -1, NOTHING)  # in a plan before
    for _ in range(400):
        together.step()
    assert not together.events and together.carriers[0].waits_for() == 1
    together.carriers[0].fence(1, 0, NOTHING)
    together.carriers[0].take_limit(0, 1)
    together.run(600.0)
    assert together.carriers[0].done and together.events
    assert_in_order(made.document, together.events)


def test_held_heads_go_on_up_to_their_limit(made: Made) -> None:
    """No more is released than was, until a limit is told; and then no more than that."""
    together = Together(made.document, Weather())
    while together.carriers[0].reached.ended < 3:
        together.step()
    for carrier in together.carriers:
        carrier.hold()
    least = [carrier.released for carrier in together.carriers]
    for _ in range(2000):
        together.step()
    assert [carrier.reached.ended for carrier in together.carriers] == least
    until = committed(made.document.plan, least, {}, 20.0)
    assert any(k > n for k, n in zip(until, least, strict=True))
    for carrier, k in zip(together.carriers, until, strict=True):
        carrier.take_limit(0, k)
    together.run(600.0)
    assert [carrier.reached.ended for carrier in together.carriers] == until
    assert all(carrier.done for carrier in together.carriers)


def test_a_paused_head_stands_and_the_others_wait(made: Made) -> None:
    """It ends the action it is at and begins no other; it goes on when it is told to."""
    together = Together(made.document, Weather())
    while together.carriers[0].reached.ended < 3:
        together.step()
    together.carriers[0].pause()
    for _ in range(2000):
        together.step()
    stood = together.carriers[0].reached
    assert not stood.begun and not together.carriers[1].done
    together.carriers[0].resume()
    together.run(600.0)
    assert all(carrier.done for carrier in together.carriers)
    assert_in_order(made.document, together.events)


@pytest.mark.parametrize("ended", [0, 5, 20])
def test_what_is_committed_needs_no_dead_head(made: Made, ended: int) -> None:
    """Below the limit every wait is for what has happened, or lies below a limit itself."""
    plan = made.document.plan
    stopped = {1: Reached(ended, True, 1)}
    until = committed(plan, [0, 0], stopped, float("inf"))
    assert until[1] == ended
    for edge in (e for k in range(until[0]) for e in plan.heads[0].after_edges(k)):
        assert edge.head == 0 or stopped[1].passed(edge.action, edge.point)
    if until[0] < len(plan.heads[0]):
        edges = plan.heads[0].after_edges(until[0])
        assert any(e.head == 1 and not stopped[1].passed(e.action, e.point) for e in edges)


def test_a_fenced_head_that_parks_is_waited_for(made: Made) -> None:
    """What it did before it failed is what the fence says; of the way to its park it tells."""
    plan = made.document.plan
    h, k = waiting(made.document)
    carrier = Carrier(h)
    (edge, *_) = [edge for edge in plan.heads[h].after_edges(k) if edge.head != h]
    before, later = (NumberedPlan(n, "plan", DIGEST, plan, (0, 1)) for n in (0, 1))
    carrier.fence(1 - h, 0, NOTHING)
    carrier.take_report(HeadReport(1 - h, 1, 1, DIGEST, Reached(edge.action + 1)))
    assert not carrier.has_passed(before, edge)
    assert carrier.has_passed(later, edge)


def test_the_rest_begins_when_who_failed_stands_at_its_park(made: Made) -> None:
    """It had begun while a head was on its way there, and met it."""
    plan = made.document.plan
    parking = NumberedPlan(1, "parks", "1" * 16, JointPlan(plan.heads), (0, 1))
    rest = NumberedPlan(2, "rest", DIGEST, JointPlan(plan.heads[:1]), (0,))
    carrier = Carrier(0)
    for each in (parking, rest):
        carrier.take_plan(each)
    carrier.fence(1, 0, NOTHING)
    whole = len(plan.heads[1])
    assert not carrier.may_begin(rest) and carrier.moving(rest) == 1
    carrier.take_report(HeadReport(1, 1, 1, parking.digest, Reached(whole - 1)))
    assert not carrier.may_begin(rest)
    carrier.take_report(HeadReport(1, 2, 1, parking.digest, Reached(whole)))
    assert carrier.may_begin(rest)
    carrier.reports.clear()
    carrier.fence(1, 1, NOTHING)  # it failed on its way, and stands where it is planned around
    assert carrier.may_begin(rest)


def test_a_head_takes_up_no_plan_while_it_holds(made: Made) -> None:
    """What it said it holds would be wrong; a plan it is taking up counts as held."""
    plan = made.document.plan
    first, later = (NumberedPlan(n, "plan", str(n) * 32, plan, (0, 1)) for n in (0, 1))
    carrier = Carrier(0)
    carrier.take_plan(first)
    carrier.hold()
    assert carrier.holds == (-1, 0) and carrier.step(0.0) == []
    carrier.take_limit(0, 0)
    carrier.step(0.0)
    carrier.take_statement(Ready(0, first.digest))
    carrier.take_plan(later)
    assert any(isinstance(command, Start) for command in carrier.step(0.0))
    assert carrier.number == 0 and carrier.holds == (1, 0)
