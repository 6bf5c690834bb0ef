"""Annealing of a bare sequence by elites, where costs are no distances.

The elites are the best sequences so far. Each annealing is short and begins hot. The near
nodes it draws are those that follow in one of the elites, and the few cheapest. So steps
that all elites share come back soon, and where elites differ the annealing decides. On
problems with few precedences and random costs one long annealing ends well above this
(docs/results/sop_ablation.md).

References
----------
Gambardella & Dorigo 2000 (sequences built from the steps of good ones, then improved);
Applegate, Bixby, Chvátal & Cook 2006, ch. 15.6 (tour merging: best in the union of tours).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from decmcts.random_kernels import below
from decmcts.search.sequence.annealing import TemperatureSchedule
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sop.annealing import Annealer, NearSteps, quenched

_ELITES = 8

_CHEAPEST = 2  # near steps by cost and by reduced cost beside those of the elites
_HOT, _COLD = 2.0, 0.05  # temperatures, in scales
_LENGTH = (4_000, 30_000)  # proposals a node: short annealings on one thread, long on the other
LEAST = 2_000  # where time allows no more
_ANNEALINGS = 60  # so many should fit into the budget
_STALE = 3 * _ELITES  # annealings in a row that find no elite


@dataclass(slots=True)
class Elites:
    """The best sequences, all of different cost."""

    most: int
    costs: list[float] = field(default_factory=list)
    orders: list[NDArray[np.int32]] = field(default_factory=list)

    @property
    def full(self) -> bool:
        """Whether a new one takes another's place."""
        return len(self.costs) == self.most

    def add(self, cost: float, order: NDArray[np.int32], *, least_gain: float) -> bool:
        """Keep a copy of a sequence if it is among the best and new; tell whether it is."""
        if any(abs(cost - other) < least_gain for other in self.costs):
            return False
        if self.full:
            worst = int(np.argmax(self.costs))
            if cost >= self.costs[worst]:
                return False
            self.costs[worst], self.orders[worst] = cost, order.copy()
        else:
            self.costs.append(cost)
            self.orders.append(order.copy())
        return True

    def following(self) -> NDArray[np.int32]:
        """Return the node after each in every elite, (n, elites); -1 after the last."""
        table = np.full((len(self.orders[0]), len(self.orders)), -1, np.int32)
        for column, order in enumerate(self.orders):
            table[order[:-1], column] = order[1:]
        return table


@dataclass(slots=True, kw_only=True)
class EliteAnnealer(Annealer):
    """Annealing after annealing, each from one of the elites, drawn at random.

    After `_STALE` annealings in a row that found no new elite all elites are dropped, and
    the search for others begins with annealings twice as long. The incumbent keeps the best.
    """

    steps: NearSteps
    least_gain: float  # costs differ by more than this
    long: bool  # whether its annealings are long ones
    _elites: Elites = field(default_factory=lambda: Elites(_ELITES))
    _failures: int = 0  # annealings in a row that found no elite
    _dropped: int = 0  # how often all elites were

    def temperature(self, spent: float) -> float:
        """Return the temperature at which the present annealing goes on."""
        schedule = TemperatureSchedule(_HOT * self.steps.scale, _COLD * self.steps.scale)
        return quenched(schedule, self.done / self.length)

    def meet(self, incumbent: Incumbent) -> None:
        """Offer the best sequence seen since the last meeting; hear of a better one."""
        Annealer.meet(self, incumbent)
        if self._elites.full and incumbent.cost < self.best - self.least_gain:
            self._elites.add(incumbent.cost, incumbent.order, least_gain=self.least_gain)
            self.best = incumbent.cost

    def end(self, spent: float) -> None:
        """Keep what the annealing found if it is good, and begin the next."""
        elites, n = self._elites, len(self.bare.order)
        found = elites.add(self.cost, self.bare.order, least_gain=self.least_gain)
        self._failures = 0 if found else self._failures + 1
        if self._failures == _STALE:
            self._elites, self._failures, self._dropped = Elites(_ELITES), 0, self._dropped + 1
            self.bare = self.bare._replace(near=self.steps.near)
        elif elites.full:
            drawn = int(below(self.state, _ELITES))
            self.take(elites.orders[drawn], elites.costs[drawn])
            if found:
                self.bare = self.bare._replace(near=self._near())
        share = self.pace / _ANNEALINGS if np.isfinite(self.pace) else 0.0
        longest = _LENGTH[self.long] * n << self._dropped
        self.length, self.done = int(min(max(share, LEAST * n), longest)), 0

    def _near(self) -> NDArray[np.int32]:
        """Return (n, k) nodes that may follow: those that do in elites, and the cheapest."""
        near, half = self.steps.near, self.steps.near.shape[1] // 2
        cheapest = (near[:, :_CHEAPEST], near[:, half : half + _CHEAPEST])
        return np.concatenate([self._elites.following(), *cheapest], axis=1)
