"""One search: what its phases share, and what one of them leaves to the next.

It begins with orders made by simple rules, and maybe one that goes by layers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Int32s
from decmcts.search.decomposition.blocks import Sequence
from decmcts.search.decomposition.threads import Threads
from decmcts.search.sequence.greedy import Greedy, layer_runs, nearest_in_layers
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.neighbours import near_ports
from decmcts.search.sequence.stopping import TemperatureSchedule


@dataclass
class HybridSearch:
    """The best sequence so far, and what phases need and find out; mutable."""

    incumbent: Incumbent
    threads: Threads
    by_layers: tuple[Int32s, NDArray[np.uint8]] | None = None  # order, directions
    layered: Sequence | None = None  # layer by layer, and worth annealing within layers

    @cached_property
    def near(self) -> Int32s:
        """Entry ports near each exit, see `near_ports`; found when first asked for."""
        return near_ports(self.incumbent.problem)

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


@dataclass(frozen=True, slots=True)
class Starts:
    """The nearest next within layers, and within height buffers of several sizes."""

    def run(self, search: HybridSearch) -> Iterator[None]:
        """Offer all of them."""
        incumbent = search.incumbent
        search.by_layers = nearest_in_layers(incumbent)
        incumbent.offer(*search.by_layers)
        Greedy().plan(incumbent, seed=0)
        incumbent.tick()
        yield


@dataclass(frozen=True, slots=True)
class LayeredStart:
    """Whether annealing within layers is worth it, and from what."""

    most_cost: float = 1.15  # of an order by layers, in costs of the best start

    def run(self, search: HybridSearch) -> Iterator[None]:
        """Set the layered start: the best sequence if it goes by layers, else the nearest.

        The nearest gets the entries that suit it, and is left out if it then costs more
        than `most_cost` times the best. There is none if there is but one layer.
        """
        group = layer_runs(search.incumbent.problem.layer)
        if group[-1] == 0:
            return
        best = search.best()
        if (np.diff(group[best.order]) >= 0).all():
            search.layered = best
        elif search.by_layers is not None:
            order, is_reversed = search.by_layers
            layered = replace(best.copy(), order=order.copy(), reversed=is_reversed.copy())
            layered.choose_entries()
            if layered.cost <= self.most_cost * best.cost:
                search.layered = layered
        yield
