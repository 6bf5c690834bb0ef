"""The planner `layerwise`: the best order within each layer, layers in the source's sequence.

This is what a careful slicer could do without looking across layers. A layer here is
a maximal run of equal layer numbers in the source. So objects that the source prints
one after the other stay so, and the sequence of layers is always allowed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.random import seeded
from decmcts.search.sequence.annealing import (
    DESCENT_FROM,
    TemperatureSchedule,
    anneal_until,
    descend_fully,
    tour_of,
)
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.neighbours import near_ports
from decmcts.search.starts.greedy import nearest_feasible


@dataclass(frozen=True, slots=True)
class Layerwise:
    """Nearest neighbour within each layer, then annealing that never leaves a layer."""

    hot: float = 1.5  # temperatures in multiples of the mean travel
    cold: float = 0.03

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        """Spend the whole budget."""
        if len(incumbent.problem) < 2:
            return
        group = layer_runs(incumbent.problem.layer)
        incumbent.offer(*nearest_in_layers(incumbent, group))
        incumbent.tick(1)
        if incumbent.over:
            return
        tour = tour_of(incumbent, near_ports(incumbent.problem), group)
        mean = incumbent.cost / len(incumbent.problem)
        schedule = TemperatureSchedule(self.hot * mean, self.cold * mean)
        anneal_until(incumbent, tour, seeded(seed), schedule, DESCENT_FROM)
        if incumbent.over:
            return
        descend_fully(incumbent, tour)
        incumbent.offer_order(incumbent.order)


def nearest_in_layers(
    incumbent: Incumbent, group: NDArray[np.int32]
) -> tuple[NDArray[np.int32], NDArray[np.uint8]]:
    """Return order and directions of the nearest-feasible rule, group after group."""
    return nearest_feasible(incumbent, group.astype(np.float64), buffer=0.0)


def layer_runs(layer: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the number of each contour's maximal run of equal layers, from 0, (n,)."""
    change = np.diff(layer) != 0
    return np.concatenate([[0], np.cumsum(change)]).astype(np.int32)[: len(layer)]
