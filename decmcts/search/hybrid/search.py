"""One search: what its phases share, and what one of them leaves to the next."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from decmcts.search.hybrid.blocks import Sequence
from decmcts.search.hybrid.threads import Threads
from decmcts.search.hybrid.trees import Trees
from decmcts.search.sequence.annealing import TemperatureSchedule
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.neighbours import near_ports

END = 0.97  # share at which what improves the sequence at random makes way for a descent


@dataclass(slots=True)
class Search:
    """The best sequence so far, the means to better it, and where phases stand; mutable."""

    incumbent: Incumbent
    threads: Threads
    trees: Trees | None
    by_layers: tuple[NDArray[np.int32], NDArray[np.uint8]] | None = None  # order, directions
    layered: Sequence | None = None  # goes by layers and is worth annealing within them
    _near: NDArray[np.int32] | None = field(default=None, repr=False)

    @property
    def near(self) -> NDArray[np.int32]:
        """Entry ports near each exit, see `near_ports`; found when first asked for."""
        if self._near is None:
            self._near = near_ports(self.incumbent.problem)
        return self._near

    def schedule(self, hot: float, cold: float) -> TemperatureSchedule:
        """Return the way between two temperatures given in mean travels of the best sequence."""
        mean = self.incumbent.cost / len(self.incumbent.problem)
        return TemperatureSchedule(hot * mean, cold * mean)

    def best(self) -> Sequence:
        """Return a copy of the best sequence so far."""
        return Sequence.best_of(self.incumbent, self.near)

    def propose(self, guest: Sequence) -> Iterator[None]:
        """Mutate the guest to the best that trees find, if there are any and they have time."""
        if self.trees is not None:
            yield from self.trees.turn(self.incumbent, self.threads, guest)


class Phase(Protocol):
    """A part of a search."""

    def run(self, search: Search) -> Iterator[None]:
        """Better the incumbent; yield wherever the search may end."""
        ...
