"""The planner `hybrid`: tree search for the large structure, annealing for the rest.

Prints whose layers have few contours are solved exactly, if there is time. Else trees
over clusters, one for each Γ, propose a start (`structure`), and what follows depends
on size and time: races of whole sequences (`races`) and then regions, one after the
other, or one sequence shared out among the threads (`sharing`). Last comes a descent.
Where contours must be some time apart, annealing takes the place of all that (`spaced`).

References
----------
Yoo et al. 2020 (tree and clusters); Gambardella & Dorigo 2000 (moves).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from decmcts.search.bounds.exact import WIDEST, Patience, solve_exactly
from decmcts.search.hybrid.lanes import Lanes, open_lanes
from decmcts.search.hybrid.pieces import Sequence
from decmcts.search.hybrid.races import Races
from decmcts.search.hybrid.regions import Regions
from decmcts.search.hybrid.sharing import Sharing
from decmcts.search.hybrid.spaced import Spaced
from decmcts.search.hybrid.structure import Trees
from decmcts.search.sequence.annealing import descend_fully, tour_of
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.neighbours import near_ports
from decmcts.search.starts.greedy import Greedy
from decmcts.search.starts.layerwise import layer_runs, nearest_in_layers


@dataclass(frozen=True, slots=True)
class Hybrid:
    """Exact solution, or tree search and annealing in turns."""

    probe: float = 0.15  # share of the budget for finding out what an exact solution takes,
    exact: float = 0.75  # and the share that may take; 0: no exact solutions
    promising: float = 1.15  # cost of going by layers, in those of the best start, worth a try;
    # 0: no layered starts
    trees: Trees = field(default_factory=Trees)
    races: Races = field(default_factory=Races)
    sharing: Sharing = field(default_factory=Sharing)
    regions: Regions = field(default_factory=Regions)
    spaced: Spaced = field(default_factory=Spaced)  # where contours must be some time apart
    end: float = 0.97  # share of the budget at which the descent begins
    crosses: bool = True  # results of threads are joined stretch by stretch
    threads: int = 2  # fixed, so that results do not depend on the machine
    anneals: bool = True  # False: trees and descent only

    def __post_init__(self) -> None:
        if self.threads < 1:
            raise ValueError("threads: expected 1 or more")

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        """Spend the budget, or stop at the first sequence without any travel."""
        if len(incumbent.problem) < 2:
            return
        if incumbent.problem.spacing is not None:
            with open_lanes(self.threads, seed) as lanes:
                self.spaced.run(incumbent, lanes)
            return
        by_layers = nearest_in_layers(incumbent, layer_runs(incumbent.problem.layer))
        incumbent.offer(*by_layers)
        Greedy().plan(incumbent, seed=seed)
        if incumbent.tick() or self._solve(incumbent) or incumbent.tick():
            return
        near = near_ports(incumbent.problem)
        layered = layered_start(incumbent, near, *by_layers, promising=self.promising)
        with open_lanes(self.threads, seed, crosses=self.crosses) as lanes:
            if self._search(incumbent, near, lanes, layered):
                return
        incumbent.offer_order(incumbent.order)
        descend_fully(incumbent, tour_of(incumbent, near))
        incumbent.offer_order(incumbent.order)

    def _solve(self, incumbent: Incumbent) -> bool:
        """Solve the problem exactly, if it is of that kind; return whether it was."""
        if self.exact == 0.0:
            return False
        patience, widest = Patience(lambda: incumbent.spent, self.probe, self.exact), WIDEST
        if incumbent.budget.iterations is not None:
            widest = min(widest, 1 + int(self.probe * incumbent.budget.iterations))

        def go_on(made: int, share: float) -> bool:
            return not incumbent.tick(made) and patience.lasts(share)

        optimum = solve_exactly(incumbent.problem, go_on, widest=widest)
        if optimum is not None:
            incumbent.offer(optimum.order, optimum.flip, optimum.seat)
            incumbent.prove(optimum.bound)
            incumbent.tick()
        return optimum is not None

    def _search(
        self,
        incumbent: Incumbent,
        near: NDArray[np.int32],
        lanes: Lanes,
        layered: Sequence | None,
    ) -> bool:
        """Take turns until the descent is due; return whether to stop."""
        if incumbent.cost == 0.0:
            return True
        if not self.anneals:
            best = Sequence.best_of(incumbent, near)
            return self.trees.grow(incumbent, lanes, best, self.end)
        if not self.races.suit(incumbent, lanes):
            return self.sharing.run(
                incumbent, near, lanes, layered, self.trees, self.regions, self.end
            )
        if self.races.run(incumbent, near, lanes, layered, self.trees):
            return True
        return self.regions.run(incumbent, Sequence.best_of(incumbent, near), lanes, self.end)


def layered_start(
    incumbent: Incumbent,
    near: NDArray[np.int32],
    order: NDArray[np.int32],
    flip: NDArray[np.uint8],
    *,
    promising: float,
) -> Sequence | None:
    """Return the best sequence if it goes by layers, else the one given if it promises enough.

    That one gets the entries that suit it and may then cost `promising` times the best.
    None too if there is but one layer, or `promising` is 0.
    """
    best, group = Sequence.best_of(incumbent, near), layer_runs(incumbent.problem.layer)
    if group[-1] == 0 or promising == 0.0:
        return None
    if (np.diff(group[best.order]) >= 0).all():
        return best
    layered = replace(best.copy(), order=order.copy(), flip=flip.copy())
    layered.settle()
    return layered if layered.cost <= promising * best.cost else None
