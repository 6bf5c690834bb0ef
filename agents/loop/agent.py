"""The loop of one agent: planner, protocol and transport put together.

One thread does everything in a fixed order, so equal seeds and equal arrivals
give equal plans. It owns no process, signal or pipe (`agents.extruder` does);
clock, transport, planner and front end are arguments.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from agents.agreeing import events
from agents.agreeing.protocol import Protocol
from agents.loop.offers import Offers
from agents.messages import kinds
from agents.messages.codec import decode, encode, kind_of
from agents.networks.transport import MALFORMED, Packet, Traffic, Transport
from decmcts.errors import InputError

if TYPE_CHECKING:  # numba loads with it
    from agents.planners.team_planner import DecMctsPlanner

TICK_S = 0.1  # how often what may have been lost is said again
SHARE_S = 0.05  # at most so often a distribution goes out: 20 a second
LONGER = 4.0  # times our longest round yet: so long we may be silent before we count as stuck
PROGRESS_S = 0.5
WAIT_S = 0.02


@dataclass(frozen=True, slots=True)
class AgentProgress:
    """Where an agent stands."""

    phase: str
    live: tuple[int, ...]
    rounds: int
    best_makespan_s: float
    elapsed_s: float
    agreeing_s: float | None  # since planning ended
    stuck: bool  # the live heads cannot print everything
    entropy: float  # of what it last sent: 0 decided, 1 all its plans alike


@dataclass(frozen=True, slots=True)
class Meet:
    """A command of a launcher: meet the others at these places, one a head."""

    places: tuple[str, ...]


class FrontEnd:
    """Who watches and commands one agent: a launcher, a terminal or a test."""

    def __init__(self) -> None:
        self.asked: list[events.ProtocolEvent | Meet] = []

    def ask(self, event: events.ProtocolEvent) -> None:
        """Queue a command of this process itself (a signal)."""
        self.asked.append(event)

    def commands(self) -> list[events.ProtocolEvent | Meet]:
        """Return what was asked since the last call."""
        asked, self.asked = self.asked, []
        return asked

    def ready(self, problem: str) -> None:
        """Show that the problem is loaded and the network open."""

    def progress(self, progress: AgentProgress, traffic: Traffic) -> None:
        """Show where the agent stands."""

    def notify(self, effect: events.Notice) -> None:
        """Show one event worth a line."""


class Agent:
    """One head's agent, with an open transport; `step` until `done`.

    Parameters
    ----------
    time_limit_s : float
        Planning time, counted from when every head is there.
    wait_s : float
        After so long the clock starts although heads are missing.
    silence_s : float
        Peers take us for stuck when we are silent for longer, and for longer than
        some rounds of ours take.
    """

    def __init__(
        self,
        head: int,
        epoch: int,
        *,
        planner: DecMctsPlanner,
        transport: Transport,
        front: FrontEnd,
        time_limit_s: float,
        clock: Callable[[], float],
        wait_s: float = 60.0,
        fenced: tuple[int, ...] = (),
        silence_s: float = kinds.SILENCE_TICKS * TICK_S,
        traffic: Traffic | None = None,
    ) -> None:
        self.protocol = Protocol(head, epoch, planner.names, planner.problem, fenced=fenced)
        self.traffic = Traffic() if traffic is None else traffic
        self.released: events.PlanReleased | None = None
        self.rounds = 0
        self._head, self._epoch, self._seq = head, epoch, 0
        self._planner, self._transport, self._front = planner, transport, front
        self._clock, self._limit_s = clock, time_limit_s
        self._began = clock()
        self._start = self._began + wait_s  # of planning; earlier when all heads are there
        self._shared = self._ticked = self._shown = self._began - 1.0
        self._live: tuple[int, ...] = (head,)
        self._stuck = False
        self._entropy = 1.0
        self._round_s = self._longest_s = 0.0  # the latest round, the longest step
        self._silence_s = silence_s
        self._offers = Offers()
        self._agreeing_since: float | None = None
        self._perform(self.protocol.start())

    @property
    def done(self) -> bool:
        """Whether we left the team."""
        return self.protocol.phase is events.Phase.LEFT

    def step(self) -> None:
        """Take in what arrived, plan one round or wait a little, speak if it is time."""
        for arrival in self._transport.receive(0.0 if self._is_planning() else WAIT_S):
            self._arrive(arrival)
        began = self._clock()
        for command in self._front.commands():
            if isinstance(command, Meet):
                self._transport.move(command.places)
            else:
                self._feed(command)
        if self._is_planning():
            self._plan()
        self._keep_time()
        self._longest_s = max(self._longest_s, self._clock() - began)

    def _is_planning(self) -> bool:
        """Whether there is something to compute: not before the heads are there."""
        started = self._clock() >= self._start and not self._stuck
        return started and self.protocol.phase is events.Phase.PLANNING

    def leave(self, reason: str) -> None:
        """Say goodbye; `done` from now on."""
        self._feed(events.Leave(reason))

    def _plan(self) -> None:
        before = self._clock()
        try:
            self._judge_offer(before)
            spent = (before - self._start) / self._limit_s if self._limit_s > 0.0 else 1.0
            self._planner.iterate(self._live, min(1.0, spent))
        except InputError as error:
            self._get_stuck(error)
            return
        self.rounds += 1
        now = self._clock()
        self._round_s = now - before
        if len(self._live) > 1:
            self._share(now)

    def _judge_offer(self, now: float) -> None:
        """Let the planner judge what a peer sent, if it claims to be better than ours."""
        if len(self._live) == 1:
            return
        best_s = self._planner.best_joint(self._live).makespan_s
        if (offer := self._offers.next(best_s, self._live, now)) is None:
            return
        head, joint = offer
        try:
            self._planner.offer(joint.plans, self._live)
        except kinds.MessageError as error:
            self.drop(f"joint plan of head {head} does not fit", str(error))
        self._offers.judged(now, self._clock())

    def _share(self, now: float) -> None:
        if now - self._shared >= SHARE_S:
            self._shared = now
            own = self._planner.distribution()
            self._entropy = own.entropy
            self._feed(own)
        joint = self._planner.best_joint(self._live)
        if self._offers.is_worth_sending(joint, now):
            self._feed(joint)

    def _get_stuck(self, error: InputError) -> None:
        # The live heads cannot print everything. Nothing to do but wait for the
        # others to come back, or for the launcher to give up.
        self._stuck = True
        self._front.notify(events.LogNote(str(error)))

    def _keep_time(self) -> None:
        now = self._clock()
        # A round cannot be cut short: end at the end that is nearer to the limit.
        end = self._start + self._limit_s - self._round_s / 2
        if now >= end and self.protocol.phase is events.Phase.PLANNING:
            self._feed(events.PlanningEnded())
        if now - self._ticked >= TICK_S:
            self._ticked = now
            self._feed(events.Tick(self._within()))
        if now - self._shown >= PROGRESS_S:
            self._shown = now
            self.show()

    def _within(self) -> int:
        """Return within how many ticks peers hear of us again, unless we are stuck."""
        seconds = max(self._silence_s, LONGER * self._longest_s)
        return min(math.ceil(seconds / TICK_S), kinds.MAX_SILENCE_TICKS)

    def show(self) -> None:
        """Report progress to the front end."""
        now = self._clock()
        progress = AgentProgress(
            self.protocol.phase.value,
            self._live,
            self.rounds,
            self._best_makespan_s(),
            now - self._began,
            None if self._agreeing_since is None else now - self._agreeing_since,
            self._stuck,
            self._entropy,
        )
        self._front.progress(progress, self.traffic)

    def _best_makespan_s(self) -> float:
        if self.released is not None:
            return self.released.makespan_s
        if self._stuck or not self.rounds:
            return float("inf")
        try:
            return self._planner.best_joint(self._live).makespan_s
        except InputError:
            return float("inf")  # the next round of planning says why

    def _arrive(self, arrival: Packet | kinds.Presence) -> None:
        if isinstance(arrival, kinds.Presence):
            self._feed(arrival)
            return
        try:
            envelope = decode(arrival.payload, self._planner.most_symbols)
            if (envelope.head, kind_of(envelope.message)) != (arrival.head, arrival.kind):
                raise kinds.MessageError("message of another head or kind than its key")
        except kinds.MessageError as error:
            # A peer's bad message is dropped, counted and logged, never fatal.
            self.drop(f"{MALFORMED} message of head {arrival.head}", str(error))
            return
        self.traffic.received[arrival.kind] += 1
        self.traffic.received_bytes[arrival.kind] += len(arrival.payload)
        self._feed(envelope)

    def drop(self, reason: str, detail: str = "") -> None:
        """Count a message that is dropped; log the first of each reason."""
        self.traffic.dropped[reason] += 1
        if self.traffic.dropped[reason] == 1:
            self._front.notify(events.LogNote(f"dropped: {reason} {detail}".rstrip()))

    def _feed(self, event: events.ProtocolEvent) -> None:
        self._perform(self.protocol.handle(event))

    def _perform(self, effects: list[events.Effect]) -> None:
        # Effects may answer with events whose effects come after those at hand.
        waiting = deque(effects)
        while waiting:
            answer = self._do(waiting.popleft())
            if answer is not None:
                waiting.extend(self.protocol.handle(answer))

    def _do(self, effect: events.Effect) -> events.ProtocolEvent | None:
        match effect:
            case events.Send(message):
                self._send(message)
            case events.Take(head, message):
                self._take(head, message)
            case events.Forget(head):
                self._planner.forget(head)
            case events.LiveChanged(live):
                self._live, self._stuck = live, False
            case events.RosterComplete():
                self._start = min(self._start, self._clock())
            case events.Propose(live, serial):
                return self._propose(live, serial=serial)
            case events.Resolve():
                return self._resolve(effect)
            case events.PlanReleased():
                self.released = effect
                self.show()
                self._front.notify(effect)
            case _:
                self._front.notify(effect)
        return None

    def _propose(self, live: tuple[int, ...], *, serial: bool) -> events.ProtocolEvent | None:
        if self._agreeing_since is None:
            self._agreeing_since = self._clock()
        try:
            return self._planner.serial(live) if serial else self._planner.best(live)
        except InputError as error:
            self._get_stuck(error)
            return None

    def _take(self, head: int, message: kinds.Distribution | kinds.Joint) -> None:
        if isinstance(message, kinds.Joint):  # judging it costs time: not each, and not at once
            self._offers.add(head, message)
            return
        try:
            self._planner.take(head, message)
        except kinds.MessageError as error:
            self.drop(f"distribution of head {head} does not fit", str(error))

    def _resolve(self, asked: events.Resolve) -> events.PlanResolved:
        try:
            found = self._planner.resolve(asked.plans, asked.live)
        except (kinds.MessageError, InputError) as error:
            self.drop("plan does not fit", str(error))
            return events.PlanResolved(asked.live, asked.claimed, "", 0.0)
        return events.PlanResolved(asked.live, asked.claimed, found.digest, found.makespan_s)

    def _send(self, message: kinds.Message) -> None:
        self._seq += 1
        try:
            payload = encode(kinds.Envelope(self._head, self._epoch, self._seq, message))
        except kinds.MessageError as error:
            self.drop("own message too large", str(error))
            return
        kind = kind_of(message)
        self.traffic.sent[kind] += 1
        self.traffic.sent_bytes[kind] += len(payload)
        self._transport.send(kind, payload, reliable=not isinstance(message, kinds.DROPPABLE))
