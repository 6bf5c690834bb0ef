"""The planner `local`: greedy starts, annealing on linear extensions, descent.

Annealing runs in rounds, each from the best sequence so far. The first round is short,
so that a search stopped early has most of the gain; the last takes most of the time.
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
from decmcts.search.starts.greedy import Greedy
from decmcts.search.starts.layerwise import layer_runs, nearest_in_layers


@dataclass(frozen=True, slots=True)
class Local:
    """Anneals the best of the source, the greedy and the layer-by-layer sequences.

    The temperatures are multiples of the mean travel between two contours;
    within a factor of three either way results hardly change.
    """

    rounds: tuple[float, ...] = (0.1, DESCENT_FROM)  # shares of the budget at which rounds end
    rounds_if_small: tuple[float, ...] = (0.1, 0.3, 0.5, 0.7, DESCENT_FROM)
    small: int = 400  # contours up to which several rounds beat one long one
    hot: float = 1.5
    cold: float = 0.03

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        """Spend the budget, or stop at the first sequence without any travel."""
        n = len(incumbent.problem)
        if n < 2:
            return
        incumbent.offer(*nearest_in_layers(incumbent, layer_runs(incumbent.problem.layer)))
        Greedy().plan(incumbent, seed=seed)
        incumbent.tick()
        if incumbent.over:
            return
        rounds = self.rounds_if_small if n <= self.small else self.rounds
        self._anneal(incumbent, near_ports(incumbent.problem), seeded(seed), rounds)
        incumbent.offer_order(incumbent.order)

    def _anneal(
        self,
        incumbent: Incumbent,
        near: NDArray[np.int32],
        state: NDArray[np.uint64],
        rounds: tuple[float, ...],
    ) -> None:
        for until in rounds:
            mean = incumbent.cost / len(incumbent.problem)
            tour = tour_of(incumbent, near)
            schedule = TemperatureSchedule(self.hot * mean, self.cold * mean)
            anneal_until(incumbent, tour, state, schedule, until)
            if incumbent.over:
                return
        descend_fully(incumbent, tour_of(incumbent, near))
