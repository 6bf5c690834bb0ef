"""One search: what its phases share, and what one of them leaves to the next."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from decmcts.search.decomposition.blocks import Sequence
from decmcts.search.decomposition.threads import Threads
from decmcts.search.sequence.annealing import TemperatureSchedule
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.neighbours import near_ports


@dataclass(slots=True)
class HybridSearch:
    """The best sequence so far, and what phases need and find out; mutable."""

    incumbent: Incumbent
    threads: Threads
    by_layers: tuple[NDArray[np.int32], NDArray[np.uint8]] | None = None  # order, directions
    layered: Sequence | None = None  # layer by layer, and worth annealing within layers
    _near: NDArray[np.int32] | None = field(default=None, repr=False)

    @property
    def near(self) -> NDArray[np.int32]:
        """Entry ports near each exit, see `near_ports`; found when first asked for."""
        if self._near is None:
            self._near = near_ports(self.incumbent.problem)
        return self._near

    def schedule(self, hot: float, cold: float) -> TemperatureSchedule:
        """Return a schedule; temperatures are given in mean travels of the best sequence."""
        mean = self.incumbent.cost / len(self.incumbent.problem)
        return TemperatureSchedule(hot * mean, cold * mean)

    def best(self) -> Sequence:
        """Return a copy of the best sequence so far."""
        return Sequence.best_of(self.incumbent, self.near)


class SearchPhase(Protocol):
    """A part of a search."""

    def run(self, search: HybridSearch) -> Iterator[None]:
        """Improve the incumbent; yield wherever the search may end."""
        ...
