"""The planner `hybrid`: tree search for the large structure, annealing for the rest.

The tree search over clusters and the annealing take turns: the best sequence
guides the trees, and the trees' best sequence races against it, a whole sequence
a thread. After a few short races the winner is annealed for most of the time by
all threads together: in a few long pieces while hot, where long moves decide the
large structure, in many short ones while cold. Small prints race to the end.

References
----------
Yoo et al. 2020 (tree and clusters); Gambardella & Dorigo 2000 (moves).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.seats import choose_visits
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

    rounds: tuple[float, ...] = (0.07, 0.16, 0.97)  # shares of the budget at which rounds end
    rounds_if_small: tuple[float, ...] = (0.1, 0.3, 0.5, 0.7, 0.97)
    small: int = 400  # contours up to which races beat one long round
    large: int = 6000  # contours from which one Γ is all that time allows
    long_pieces: float = 0.5  # share of the last round
    for_structure: float = 0.02  # share of the budget for the trees before each race
    gammas: tuple[float, ...] = (0.3, 0.5, 0.7, 0.9)
    hot: float = 1.5
    warm: float = 0.2  # from here on the structure stays
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
        races = rounds if n <= self.small else rounds[:-1]
        for number, until in enumerate(races):
            if number > 0 and self._found(incumbent, lanes, guest):
                return True
            rivals = [_sequence(incumbent, near), guest]
            hot, _, cold = self._heats(incumbent)
            if hot == 0.0 or anneal_rivals(incumbent, rivals, lanes, Cooling(hot, cold), until):
                return True
        return n > self.small and self._share_out(incumbent, near, lanes, rounds[-1])

    def _share_out(
        self, incumbent: Incumbent, near: NDArray[np.int32], lanes: Lanes, until: float
    ) -> bool:
        """Anneal the best sequence on all threads together; return whether to stop."""
        hot, warm, cold = self._heats(incumbent)
        sequence, began = _sequence(incumbent, near), incumbent.spent
        half = began + self.long_pieces * (until - began)
        return (
            hot == 0.0
            or anneal_pieces(incumbent, sequence, lanes, Cooling(hot, warm), half, a_lane=1)
            or anneal_pieces(incumbent, sequence, lanes, Cooling(warm, cold), until, a_lane=4)
        )

    def _heats(self, incumbent: Incumbent) -> tuple[float, float, float]:
        """Return the hot, the warm and the cold temperature for the best sequence, mm."""
        mean = incumbent.cost / len(incumbent.problem)
        return self.hot * mean, self.warm * mean, self.cold * mean

    def _found(self, incumbent: Incumbent, lanes: Lanes, guest: Sequence) -> bool:
        """Mutate the guest to the trees' best sequence; return whether to stop."""
        gammas = self.gammas if len(guest.order) < self.large else self.gammas[1:2]
        searches = gamma_searches(incumbent, gammas, lanes.fresh(len(gammas)))
        until = incumbent.spent + self.for_structure
        best, stop = search_structure(
            incumbent, searches, lanes, exploration=self.exploration, until=until
        )
        guest.order[:], guest.flip[:] = best.order, best.flip
        if incumbent.problem.seams is not None:
            guest.flip[:], guest.seat[:] = choose_visits(
                incumbent.metric,
                guest.order,
                incumbent.problem.reversible,
                incumbent.problem.seams.offsets,
            )
        incumbent.notes["gamma"] = best.gamma
        return stop


def _sequence(incumbent: Incumbent, near: NDArray[np.int32]) -> Sequence:
    """Return a mutable copy of the best sequence."""
    return Sequence(
        incumbent.problem,
        incumbent.metric,
        near,
        incumbent.order.copy(),
        incumbent.flip.copy(),
        incumbent.seat.copy(),
    )
