"""What the search begins with: orders made by simple rules, and maybe one that goes by layers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from decmcts.search.hybrid.search import HybridSearch
from decmcts.search.sequence.greedy import Greedy, layer_runs, nearest_in_layers


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

    most_cost: float = 1.15  # of an order by layers, in costs of the best start; 0: never

    def run(self, search: HybridSearch) -> Iterator[None]:
        """Set the layered start: the best sequence if it goes by layers, else the nearest.

        The nearest gets the entries that suit it, and is left out if it then costs more
        than `most_cost` times the best. There is none if there is but one layer.
        """
        group = layer_runs(search.incumbent.problem.layer)
        if self.most_cost == 0.0 or group[-1] == 0:
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
