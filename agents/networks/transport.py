"""What an agent needs of a network, and the network of an agent that is alone.

A transport moves bytes and says who is there. It knows keys, not messages:
encoding is `agents.messages.codec`'s, reactions are `agents.agreeing.protocol`'s.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

from agents.messages.kinds import Presence


@dataclass(frozen=True, slots=True)
class Packet:
    """Bytes that arrived under a head's key."""

    head: int
    kind: str
    payload: bytes


Arrival = Packet | Presence

FORGED, MALFORMED, STRANGE = "forged", "malformed", "strange key"
DISTURBS = FORGED, MALFORMED, STRANGE
"""How reasons of drops begin that say that somebody disturbs; peers do nothing of the kind."""


@dataclass(slots=True)
class Traffic:
    """Counts of what went out and came in; changed in place by its owner."""

    sent: Counter[str] = field(default_factory=Counter)  # messages by kind
    sent_bytes: Counter[str] = field(default_factory=Counter)
    received: Counter[str] = field(default_factory=Counter)  # and well formed
    received_bytes: Counter[str] = field(default_factory=Counter)
    dropped: Counter[str] = field(default_factory=Counter)  # by reason

    def counts(self) -> dict[str, dict[str, int]]:
        """Return all counts as plain dictionaries."""
        return {name: dict(getattr(self, name)) for name in self.__slots__}


class Transport(ABC):
    """One agent's side of a network, open inside `with`."""

    def __enter__(self) -> Self:
        """Open the network and announce this head."""
        return self

    @abstractmethod
    def __exit__(self, *error: object) -> None:
        """Leave the network."""

    @abstractmethod
    def send(self, kind: str, payload: bytes, *, reliable: bool) -> None:
        """Hand over bytes for all peers; never blocks, may drop unreliable ones."""

    @abstractmethod
    def receive(self, timeout_s: float) -> list[Arrival]:
        """Return what arrived, waiting at most `timeout_s` for the first."""

    @abstractmethod
    def move(self, places: Sequence[str]) -> None:
        """Meet the others at other places from now on."""


class NoNetwork(Transport):
    """The transport of the single-extruder mode: it meets nobody."""

    def __exit__(self, *error: object) -> None:
        """There is nothing to leave."""

    def send(self, kind: str, payload: bytes, *, reliable: bool) -> None:
        """Nobody hears."""

    def receive(self, timeout_s: float) -> list[Arrival]:
        """Wait; nothing arrives."""
        time.sleep(timeout_s)
        return []

    def move(self, places: Sequence[str]) -> None:
        """There is nobody to meet."""
