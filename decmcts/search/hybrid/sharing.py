"""One sequence shared out among all threads, for prints too large for races.

On the largest a layered start is annealed within layers first. Then come the trees
and a first, fast annealing, then a long one: in long pieces while hot, where long
moves decide the large structure, in many short ones while cold. Half-way the trees,
guided by what annealing made of the sequence, get another turn. At last regions, with
stretches solved exactly in between; where there is less time stretches alone, where
there is least neither.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts.search.hybrid.lanes import Lanes, anneal_pieces, anneal_rivals
from decmcts.search.hybrid.pieces import Sequence
from decmcts.search.hybrid.regions import Regions
from decmcts.search.hybrid.stretches import solve_all_stretches
from decmcts.search.hybrid.structure import Trees
from decmcts.search.sequence.annealing import Cooling
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.starts.layerwise import layer_runs


@dataclass(frozen=True, slots=True)
class Sharing:
    """Shares of the budget, and temperatures in multiples of the mean travel."""

    layers_from: int = 6000  # contours from which a layered start is annealed first
    layers: float = 0.06  # share of the budget for that
    first: float = 0.05  # share of the budget for a first, fast annealing
    half_way: float = 0.5  # share of the budget at which the trees get their second turn
    regions_from: float = 0.75  # share of the budget at which regions begin,
    for_regions: float = 15_000.0  # if there are so many steps for each contour in all
    stretches_from: float = 0.85  # or at which stretches are solved exactly,
    for_stretches: float = 2000.0  # if there are only so many
    pieces: tuple[int, int] = (1, 4)  # of each thread, hot and cold; 0: whole sequences alone
    hot: float = 1.5
    warm: float = 0.2  # from here on the structure stays
    cold: float = 0.03

    def __post_init__(self) -> None:
        if min(self.hot, self.warm, self.cold) <= 0.0:
            raise ValueError("hot, warm and cold: expected more than 0")

    def run(
        self,
        incumbent: Incumbent,
        near: NDArray[np.int32],
        lanes: Lanes,
        layered: Sequence | None,
        trees: Trees,
        regions: Regions,
        end: float,
    ) -> bool:
        """Improve the best sequence until the share `end` is spent; return whether to stop."""
        large = len(incumbent.problem) >= self.layers_from
        if large and layered is not None and self._in_layers(incumbent, lanes, layered):
            return True
        if trees.turn(incumbent, lanes, Sequence.best_of(incumbent, near)):
            return True
        sequence, cooling = Sequence.best_of(incumbent, near), self._cooling(incumbent)
        first = incumbent.spent + self.first
        if anneal_pieces(incumbent, sequence, lanes, cooling, first, a_lane=self.pieces[0]):
            return True
        return self._anneal(incumbent, near, lanes, trees, regions, end)

    def _cooling(self, incumbent: Incumbent) -> Cooling:
        """Return all the way from hot to cold, for the best sequence."""
        mean = incumbent.cost / len(incumbent.problem)
        return Cooling(self.hot * mean, self.cold * mean)

    def _in_layers(self, incumbent: Incumbent, lanes: Lanes, layered: Sequence) -> bool:
        """Anneal within layers on each lane, join the best; return whether to stop."""
        if incumbent.cost == 0.0:
            return True
        rivals, until = [layered.copy() for _ in lanes.states], incumbent.spent + self.layers
        coolings = [self._cooling(incumbent)] * len(rivals)
        groups = [layer_runs(incumbent.problem.layer)] * len(rivals)
        if anneal_rivals(incumbent, rivals, lanes, coolings, until, groups=groups):
            return True
        found = lanes.join(rivals)
        found.settle()
        incumbent.offer(found.order, found.flip, found.seat)
        return False

    def _anneal(
        self,
        incumbent: Incumbent,
        near: NDArray[np.int32],
        lanes: Lanes,
        trees: Trees,
        regions: Regions,
        end: float,
    ) -> bool:
        """Cool one sequence down on all threads together; return whether to stop."""
        sequence = Sequence.best_of(incumbent, near)
        mean = incumbent.cost / len(incumbent.problem)
        falling = Cooling(self.hot * mean, self.warm * mean)
        if anneal_pieces(incumbent, sequence, lanes, falling, self.half_way, a_lane=self.pieces[0]):
            return True
        if trees.turn(incumbent, lanes, Sequence.best_of(incumbent, near)):
            return True
        if incumbent.cost < sequence.cost:  # the trees', or that of the first annealing
            sequence = Sequence.best_of(incumbent, near)
        steps = incumbent.iterations / (incumbent.spent * len(incumbent.problem))
        many, some = steps >= self.for_regions, steps >= self.for_stretches
        until = self.regions_from if many else self.stretches_from if some else end
        falling = Cooling(self.warm * mean, self.cold * mean)
        if anneal_pieces(incumbent, sequence, lanes, falling, until, a_lane=self.pieces[1]):
            return True
        best = Sequence.best_of(incumbent, near)
        if many:
            return regions.run(incumbent, best, lanes, end)
        return some and solve_all_stretches(incumbent, best, lanes, end)
