"""Networks made worse: one in memory with its own clock, for tests and experiments, and any other.

Seeded loss, delay, reordering (delays differ) and duplication hit every
message, reliable ones too: the protocol must live with worse than zenoh does
to it. Presence is told like zenoh's liveliness: never lost, in order. Behind a
`LossyTransport` real messages are as bad.
"""

from __future__ import annotations

import heapq
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Self

import numpy as np

from agents.messages.kinds import Presence
from agents.networks.transport import Arrival, Packet, Transport


@dataclass(frozen=True, slots=True)
class Weather:
    """How bad the network is."""

    loss: float = 0.0  # probability that a message to one peer vanishes
    delay_s: tuple[float, float] = (0.0, 0.0)  # uniform between
    duplicate: float = 0.0  # probability that it arrives twice

    def delays(self, rng: np.random.Generator) -> Iterator[float]:
        """Yield how late each copy of a message arrives that is not lost, s."""
        for _ in range(1 + int(rng.random() < self.duplicate)):
            if rng.random() >= self.loss:
                yield float(rng.uniform(*self.delay_s))


class MemoryNetwork:
    """Connects `MemoryTransport`s; `advance` moves its clock."""

    def __init__(self, rng: np.random.Generator, weather: Weather = Weather()) -> None:
        self.now = 0.0
        self.weather = weather
        self.transports: dict[int, MemoryTransport] = {}
        self._rng = rng
        self._flying: list[tuple[float, int, int, Arrival]] = []
        self._numbers = count()

    def advance(self, seconds: float) -> None:
        """Let time pass and deliver what is due."""
        self.now += seconds
        while self._flying and self._flying[0][0] <= self.now:
            _, _, to, arrival = heapq.heappop(self._flying)
            transport = self.transports.get(to)
            if transport is not None and not self._is_stale(to, arrival):
                transport.inbox.append(arrival)

    def _is_stale(self, to: int, arrival: Arrival) -> bool:
        """Whether this arrival announces a token that is not there any more."""
        if not isinstance(arrival, Presence) or not arrival.alive:
            return False
        of = self.transports.get(arrival.head)
        return of is None or of.epoch != arrival.epoch

    def join(self, transport: MemoryTransport) -> None:
        """Connect a transport; both sides learn of each other."""
        self.transports[transport.head] = transport
        self._announce(transport, alive=True, delay_s=0.0)
        for other in self.transports.values():
            if other.head != transport.head:
                self._fly(transport.head, Presence(other.head, other.epoch, True), 0.0)

    def kill(self, head: int) -> None:
        """Let a head die like kill -9: its peers see it at once."""
        transport = self.transports.pop(head)
        self._announce(transport, alive=False, delay_s=0.005)

    def publish(self, packet: Packet) -> None:
        """Send a packet to all other heads through the weather."""
        for to in sorted(self.transports):
            for delay_s in self.weather.delays(self._rng) if to != packet.head else ():
                self._fly(to, packet, delay_s)

    def _announce(self, transport: MemoryTransport, *, alive: bool, delay_s: float) -> None:
        for to in sorted(self.transports):
            if to != transport.head:
                self._fly(to, Presence(transport.head, transport.epoch, alive), delay_s)

    def _fly(self, to: int, arrival: Arrival, delay_s: float) -> None:
        heapq.heappush(self._flying, (self.now + delay_s, next(self._numbers), to, arrival))


class MemoryTransport(Transport):
    """One head's side of a `MemoryNetwork`."""

    def __init__(self, network: MemoryNetwork, head: int, epoch: int = 1) -> None:
        self.network = network
        self.head = head
        self.epoch = epoch
        self.inbox: list[Arrival] = []

    def __enter__(self) -> Self:
        self.network.join(self)
        return self

    def __exit__(self, *error: object) -> None:
        if self.network.transports.get(self.head) is self:
            self.network.kill(self.head)

    def send(self, kind: str, payload: bytes, *, reliable: bool) -> None:
        """Publish; reliability is not given here, on purpose."""
        self.network.publish(Packet(self.head, kind, payload))

    def receive(self, timeout_s: float) -> list[Arrival]:
        """Return what arrived; time passes only in `MemoryNetwork.advance`."""
        arrived, self.inbox = self.inbox, []
        return arrived

    def move(self, places: Sequence[str]) -> None:
        """There is one network only."""


class LossyTransport(Transport):
    """A transport behind which the weather is bad; its delays are seconds of the world."""

    def __init__(self, inner: Transport, weather: Weather, rng: np.random.Generator) -> None:
        self._inner, self._weather, self._rng = inner, weather, rng
        self._late: list[tuple[float, int, Packet]] = []
        self._numbers = count()

    def __enter__(self) -> Self:
        self._inner.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._inner.__exit__(*error)

    def send(self, kind: str, payload: bytes, *, reliable: bool) -> None:
        """Send: what arrives is made worse by those who hear it."""
        self._inner.send(kind, payload, reliable=reliable)

    def receive(self, timeout_s: float) -> list[Arrival]:
        """Return what arrived, and was not lost, at its time."""
        found: list[Arrival] = []
        for arrival in self._inner.receive(timeout_s):
            if not isinstance(arrival, Packet):
                found.append(arrival)
                continue
            for delay_s in self._weather.delays(self._rng):
                due = time.monotonic() + delay_s
                heapq.heappush(self._late, (due, next(self._numbers), arrival))
        while self._late and self._late[0][0] <= time.monotonic():
            found.append(heapq.heappop(self._late)[2])
        return found

    def move(self, places: Sequence[str]) -> None:
        """Meet the others elsewhere."""
        self._inner.move(places)
