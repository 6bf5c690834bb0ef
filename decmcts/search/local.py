"""The planner `local`: greedy starts, then annealing on linear extensions, then descent."""

from __future__ import annotations

from dataclasses import dataclass

from decmcts._kernels.random import seeded
from decmcts.search.annealing import Cooling, anneal_until, tour_of
from decmcts.search.greedy import Greedy
from decmcts.search.incumbent import Incumbent
from decmcts.search.neighbours import near_ports


@dataclass(frozen=True, slots=True)
class Local:
    """Anneals the best greedy sequence."""

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        """Spend the whole budget."""
        if len(incumbent.problem) < 2:
            return
        Greedy().plan(incumbent, seed=seed)
        if incumbent.tick():
            return
        tour = tour_of(incumbent, near_ports(incumbent.problem))
        mean = incumbent.cost_mm / len(incumbent.problem)
        if mean == 0.0:
            return
        cooling = Cooling(0.5 * mean, 0.01 * mean)
        anneal_until(incumbent, tour, seeded(seed), cooling, 1.0)
        incumbent.offer_order(incumbent.order)
