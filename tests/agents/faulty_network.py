"""A network in memory whose heads hang, and which is cut between two of them."""

from __future__ import annotations

import numpy as np

from agents.messages.kinds import Presence
from agents.networks.memory import MemoryNetwork, MemoryTransport, Weather
from agents.networks.transport import Arrival, Packet


class FaultyNetwork(MemoryNetwork):
    """Peers see that a head hangs, or that they are cut off from it, after its lease."""

    lease_s = 1.0

    def __init__(self, rng: np.random.Generator, weather: Weather) -> None:
        super().__init__(rng, weather)
        self.hung: dict[int, MemoryTransport] = {}
        self._cut: set[frozenset[int]] = set()

    def hang(self, head: int) -> None:
        """Stop a head."""
        self.hung[head] = self.transports.pop(head)
        self._announce(self.hung[head], alive=False, delay_s=self.lease_s)

    def resume(self, head: int) -> None:
        """Let a hung head go on; its sessions open again."""
        self.transports[head] = self.hung.pop(head)
        self._announce(self.transports[head], alive=True, delay_s=self.lease_s)
        for other in self.transports.values():
            if other.head != head:
                gone, back = (Presence(other.head, other.epoch, alive) for alive in (False, True))
                self._fly(head, gone, 0.0)
                self._fly(head, back, self.lease_s)

    def kill(self, head: int) -> None:
        if head in self.hung:
            self.transports[head] = self.hung.pop(head)
        super().kill(head)

    def cut(self, a: int, b: int) -> None:
        """Lose every message between two heads from now on."""
        self._cut.add(frozenset((a, b)))
        self._tell_each_other(a, b, alive=False)

    def heal(self, a: int, b: int) -> None:
        """Undo `cut`."""
        self._cut.discard(frozenset((a, b)))
        self._tell_each_other(a, b, alive=True)

    def _tell_each_other(self, a: int, b: int, *, alive: bool) -> None:
        known = self.transports | self.hung
        for to, of in ((a, b), (b, a)):
            self._fly(to, Presence(of, known[of].epoch, alive), self.lease_s)

    def _is_stale(self, to: int, arrival: Arrival) -> bool:
        begins = isinstance(arrival, Presence) and arrival.alive
        is_cut = begins and frozenset((to, arrival.head)) in self._cut
        return is_cut or super()._is_stale(to, arrival)

    def _fly(self, to: int, arrival: Arrival, delay_s: float) -> None:
        if not (isinstance(arrival, Packet) and frozenset((to, arrival.head)) in self._cut):
            super()._fly(to, arrival, delay_s)
