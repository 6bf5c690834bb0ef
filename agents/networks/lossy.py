"""A network made worse: messages are lost, late, doubled and overtake each other.

For trying out what real networks do now and then. Presence is told as it is.
"""

from __future__ import annotations

import heapq
import time
from collections.abc import Sequence
from itertools import count
from typing import Self

import numpy as np

from agents.networks.memory import Weather
from agents.networks.transport import Arrival, Packet, Transport


class LossyTransport:
    """A transport behind which the weather is bad; its delays are seconds of the world."""

    def __init__(self, inner: Transport, weather: Weather, rng: np.random.Generator) -> None:
        self._inner, self._weather, self._rng = inner, weather, rng
        self._late: list[tuple[float, int, Packet]] = []
        self._numbers = count()

    def __enter__(self) -> Self:
        """Open the network."""
        self._inner.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        """Leave it."""
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
