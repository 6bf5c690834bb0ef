"""Annealing where contours that lie on each other must be some time apart.

Trees, regions and exact solutions know no time. What is left is strong enough: moves
that keep the time, on one whole sequence a thread, from the source's own order on,
which keeps it.
"""

from __future__ import annotations

from dataclasses import dataclass

from decmcts.search.hybrid.lanes import Lanes, anneal_rivals
from decmcts.search.hybrid.pieces import Sequence
from decmcts.search.sequence.annealing import Cooling, descend_fully, tour_of
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.neighbours import near_ports


@dataclass(frozen=True, slots=True)
class Spaced:
    """Rounds of annealing, each from the best so far; temperatures in mean travels."""

    rounds: tuple[float, ...] = (0.1, 0.97)  # shares of the budget at which rounds end
    hot: float = 0.5
    cold: float = 0.03

    def run(self, incumbent: Incumbent, lanes: Lanes) -> None:
        """Spend the budget, or stop at the first sequence without any travel."""
        if incumbent.tick():
            return
        near = near_ports(incumbent.problem)
        for until in self.rounds:
            mean = incumbent.cost / len(incumbent.problem)
            if mean == 0.0:
                return
            best = Sequence.best_of(incumbent, near)
            rivals = [best.copy() for _ in lanes.states]
            coolings = [Cooling(self.hot * mean, self.cold * mean)] * len(rivals)
            if anneal_rivals(incumbent, rivals, lanes, coolings, until):
                return
        descend_fully(incumbent, tour_of(incumbent, near))
        incumbent.offer_order(incumbent.order)
