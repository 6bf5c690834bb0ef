"""The planner `hybrid`: tree search for the large structure, annealing for the rest.

The tree search over clusters and the annealing take turns: the best sequence
guides the trees, and the trees' best sequence races against it. In the hot part
of the annealing, where long moves decide the large structure, each thread anneals
a whole sequence; the better one is cooled further on all threads at once, a
piece each. Small prints race to the end, in several rounds; on prints too large
for a whole sequence to converge in the time, pieces are annealed from the
beginning.

References
----------
Yoo et al. 2020 (tree and clusters); Gambardella & Dorigo 2000 (moves).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts.search.annealing import Cooling, descend_fully, tour_of
from decmcts.search.greedy import Greedy
from decmcts.search.incumbent import Incumbent
from decmcts.search.lanes import Lanes, anneal_pieces, anneal_rivals, open_lanes
from decmcts.search.layerwise import layer_runs, nearest_in_layers
from decmcts.search.neighbours import near_ports
from decmcts.search.pieces import Sequence
from decmcts.search.structure import gamma_searches, search_structure

_LANES = 2  # fixed, so that results do not depend on the machine


@dataclass(frozen=True, slots=True)
class Hybrid:
    """Tree search and annealing in turns; temperatures in multiples of the mean travel."""

    rounds: tuple[float, ...] = (0.1, 0.97)  # shares of the budget at which rounds end
    rounds_if_small: tuple[float, ...] = (0.1, 0.3, 0.5, 0.7, 0.97)
    small: int = 400  # contours up to which several rounds beat one long one
    large: int = 6000  # contours from which pieces beat rivals
    race: float = 0.4  # share of a round in which whole sequences race
    for_structure: float = 0.02  # share of the budget for the trees before each race
    gammas: tuple[float, ...] = (0.3, 0.5, 0.7, 0.9)
    hot: float = 1.5
    warm: float = 0.25  # from here on the structure stays
    cold: float = 0.03
    exploration: float = 0.05  # of UCB1; rewards of good sequences differ little

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        """Spend the budget, or stop at the first sequence without any travel."""
        if len(incumbent.problem) < 2:
            return
        incumbent.offer(*nearest_in_layers(incumbent, layer_runs(incumbent.problem.layer)))
        Greedy().plan(incumbent, seed=seed)
        if incumbent.tick():
            return
        near = near_ports(incumbent.problem)
        with open_lanes(_LANES, seed) as lanes:
            if self._search(incumbent, near, lanes):
                return
        if not descend_fully(incumbent, tour_of(incumbent, near)):
            incumbent.offer_order(incumbent.order)

    def _search(self, incumbent: Incumbent, near: NDArray[np.int32], lanes: Lanes) -> bool:
        """Run all rounds; return whether to stop."""
        n = len(incumbent.problem)
        rounds = self.rounds_if_small if n <= self.small else self.rounds
        guest = _sequence(incumbent, near)
        for number, until in enumerate(rounds):
            if incumbent.cost_mm == 0.0 or self._race(incumbent, near, lanes, guest, until):
                return True
            if number + 1 < len(rounds) and self._found(incumbent, lanes, guest):
                return True
        return False

    def _race(
        self,
        incumbent: Incumbent,
        near: NDArray[np.int32],
        lanes: Lanes,
        guest: Sequence,
        until: float,
    ) -> bool:
        """Anneal the best sequence, and the guest beside it; return whether to stop."""
        n, began = len(guest.order), incumbent.spent
        mean, best = incumbent.cost_mm / n, _sequence(incumbent, near)
        hot, warm, cold = self.hot * mean, self.warm * mean, self.cold * mean
        if n >= self.large:
            return anneal_pieces(incumbent, best, lanes, Cooling(hot, cold), until)
        if n <= self.small:
            return anneal_rivals(incumbent, [best, guest], lanes, Cooling(hot, cold), until)
        half = began + self.race * (until - began)
        if anneal_rivals(incumbent, [best, guest], lanes, Cooling(hot, warm), half):
            return True
        winner = min((best, guest), key=lambda sequence: sequence.cost_mm)
        return anneal_pieces(incumbent, winner, lanes, Cooling(warm, cold), until)

    def _found(self, incumbent: Incumbent, lanes: Lanes, guest: Sequence) -> bool:
        """Mutate the guest to the trees' best sequence; return whether to stop."""
        gammas = self.gammas if len(guest.order) < self.large else self.gammas[1:2]
        searches = gamma_searches(incumbent, gammas, lanes.fresh(len(gammas)))
        until = incumbent.spent + self.for_structure
        best, stop = search_structure(
            incumbent, searches, lanes, exploration=self.exploration, until=until
        )
        guest.order[:], guest.flip[:] = best.order, best.flip
        incumbent.notes["gamma"] = best.gamma
        return stop


def _sequence(incumbent: Incumbent, near: NDArray[np.int32]) -> Sequence:
    """Return a mutable copy of the best sequence."""
    return Sequence(
        incumbent.problem,
        incumbent.ports,
        near,
        incumbent.order.copy(),
        incumbent.flip.copy(),
    )
