"""The relaxation behind the certificate: arborescences of travels at prices.

Why its value is a bound is proved in `decmcts.search.bounds.certificate`, which also
looks for good prices. The arithmetic of prices lives in `decmcts.search.bounds.pricing_kernels`,
sets that must be left often in `decmcts.search.bounds.crossings`, travels of
which an order uses one in `decmcts.search.bounds.exclusive_travels`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts.feasibility.build import closure_of
from decmcts.search.bounds.arborescence_kernels import cheapest_arborescence
from decmcts.search.bounds.choices import choices_of
from decmcts.search.bounds.crossings import Crossings, forced_crossings
from decmcts.search.bounds.exclusive_travels import ExclusiveTravels, find_exclusive_travels
from decmcts.search.bounds.pricing_kernels import (
    WORD,
    Boxes,
    PossibleTravels,
    Prices,
    add_descendants,
    arc_weights,
    bounds_of,
    cover_mask,
    price_travels,
    travel_costs,
    used_choices,
)
from decmcts.search.sequence.metric_kernels import costliest, distance, points_of
from decmcts.search.sequence.problem import OrderProblem

WIDTH = 8  # see `Relaxation`
ROUNDING = 1e-9  # of the largest number, times n: what a value is lowered by; see `evaluate`


@dataclass(frozen=True, slots=True)
class TravelArcs:
    """Travels that are looked at, by the contour they lead to; the root is the tail n."""

    offsets: NDArray[np.int64]  # (n + 1,)
    tails: NDArray[np.int64]  # (m,)
    heads: NDArray[np.int64]  # (m,)
    cost: NDArray[np.float64]  # (m, 4) without prices, from either choice to either choice

    @staticmethod
    def of(codes: NDArray[np.int64], cost: NDArray[np.float64], n: int) -> TravelArcs:
        """Sort distinct arcs, each coded as tail · n + head, by their head."""
        tails, heads = codes // n, codes % n
        order = np.argsort(heads, kind="stable")
        offsets = np.concatenate([[0], np.cumsum(np.bincount(heads, minlength=n))])
        return TravelArcs(offsets.astype(np.int64), tails[order], heads[order], cost[order])


@dataclass(frozen=True, slots=True)
class Relaxed:
    """The value of the relaxation at some prices, and how to raise it."""

    value: float  # in the metric's unit
    slope: NDArray[np.float64]  # as the multipliers
    rounding: float  # what rounding added to the value at the very most


class Relaxation:
    """Arborescences with a way back to the root, at prices (`decmcts.search.bounds.certificate`).

    Multipliers are one vector: to leave each contour and the root (n + 1), for the
    choices for (w), for the sets (s), for the exclusive travels (p). `width` travels to
    each contour are taken up in each pricing.
    """

    def __init__(self, problem: OrderProblem, *, width: int = WIDTH) -> None:
        n = self.n = len(problem)
        self._width = width
        self.choices = choices_of(problem)
        points = points_of(self.choices.metric)
        self.boxes = Boxes(np.empty((n, 6)), np.empty((n, 6)), np.empty((-(-n // WORD), 6)))
        bounds_of(self.choices, points, self.boxes)
        self.rule, self.exclusive = _precedence(problem)
        self.crossings: Crossings = forced_crossings(problem)
        graph, count = problem.graph, np.diff(self.choices.offsets)
        self.first = np.flatnonzero(np.diff(graph.pred_offsets) == 0)
        self.last = np.flatnonzero(np.diff(graph.succ_offsets) == 0)
        self.has_others = np.repeat(count > 1, count)  # choices that have another beside them
        self.size = n + 1 + len(self.has_others) + len(self.crossings.exits) + self.exclusive.count
        self._by_choice = slice(n + 1, n + 1 + len(self.has_others))
        self._sets = slice(self._by_choice.stop, self._by_choice.stop + len(self.crossings.exits))
        self._tolls = slice(self._sets.stop, None)
        self.codes, self._cost = np.empty(0, np.int64), np.empty((0, 4))
        self._list(np.union1d(n * n + self.first, self.exclusive.keys))
        self.escape = np.full(n, np.inf)
        corners = np.stack([points.min(axis=0), points.max(axis=0)])
        self.reach = float(distance(costliest(self.choices.metric, corners), 0, 1))

    def prices(self, at: NDArray[np.float64]) -> Prices:
        """Return the multipliers, but those for exclusive travels, as prices of travels."""
        member = self.crossings.member
        refund = (member * at[self._sets]) @ (~member).T.astype(np.float64)
        return Prices(
            at[: self.n + 1], at[self._by_choice], self.crossings.zone, np.ascontiguousarray(refund)
        )

    def allowed(self, at: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the nearest multipliers that keep the value a bound."""
        free = self._by_choice.stop
        return np.concatenate([at[:free], np.maximum(at[free:], 0.0)])

    def take_up(self, at: NDArray[np.float64]) -> None:
        """Add the travels that are cheapest at these prices; bound what is left out.

        After this `evaluate` at the same multipliers is a valid bound.
        """
        prices = self.prices(at)
        tails, self.escape = price_travels(self.choices, self.boxes, self.rule, prices, self._width)
        heads = np.broadcast_to(np.arange(self.n)[:, None], tails.shape)
        self._list(np.union1d(self.codes, (tails * self.n + heads)[tails >= 0]))

    def evaluate(self, at: NDArray[np.float64]) -> Relaxed:
        """Return the relaxation's value at some multipliers.

        No key of the heaps exceeds twice the largest price M, and each undergoes at
        most n subtractions, so rounding makes the arborescence too dear by no more
        than some 4 n² · 1.1e-16 · M. `ROUNDING` covers that up to a million contours.
        """
        n, m, arcs = self.n, len(self.codes), self.arcs
        prices, offsets = self.prices(at), self.choices.offsets
        weight = np.empty(m + n)
        weight[m:] = self.escape
        arc_weights(offsets, arcs.tails, arcs.heads, arcs.cost, prices, weight[:m])
        tolls = self.exclusive.of @ at[self._tolls]
        weight[self._priced] += tolls[self._exclusive]
        chosen = cheapest_arborescence(arcs.offsets, arcs.tails, weight[:m], self.escape)
        cheapest = np.minimum.reduceat(prices.by_choice, offsets[:-1])
        back = prices.leave[self.last] + cheapest[self.last]
        home = int(np.argmin(back))
        value = weight[chosen].sum() + back[home] - prices.leave.sum()
        value += at[self._sets] @ self.crossings.exits - at[self._tolls].sum()
        largest = self.reach + 4.0 * np.abs(at).max() + prices.crossing.max()
        largest += tolls.max(initial=0.0) + at[self._tolls].sum() / n
        slope = self._slope(prices, chosen[chosen < m], int(self.last[home]))
        return Relaxed(float(value), slope, ROUNDING * n * float(largest))

    def _slope(self, prices: Prices, chosen: NDArray[np.int64], home: int) -> NDArray[np.float64]:
        """Return the subgradient: how far the arborescence is from a path."""
        n, offsets, slope = self.n, self.choices.offsets, np.zeros(self.size)
        arcs = self.arcs
        tails, heads = arcs.tails[chosen], arcs.heads[chosen]
        slope[: n + 1] = np.bincount(tails, minlength=n + 1) - 1.0
        slope[home] += 1.0
        used = used_choices(offsets, tails, heads, arcs.cost[chosen], prices.by_choice)
        mine = slice(offsets[home], offsets[home + 1])
        used[mine.start + int(np.argmin(prices.by_choice[mine]))] += 1.0
        slope[self._by_choice] = np.where(self.has_others, used, 0.0)
        real = tails < n
        zone, member = self.crossings.zone, self.crossings.member
        leaving = member[zone[tails[real]]] & ~member[zone[heads[real]]]
        slope[self._sets] = self.crossings.exits - leaving.sum(axis=0)
        slope[self._tolls] = self.exclusive.of.T @ self._used(chosen) - 1.0
        return slope

    def _used(self, chosen: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return how often each travel that passes is used."""
        is_chosen = np.zeros(len(self.codes), np.bool_)
        is_chosen[chosen] = True
        used = self._exclusive[is_chosen[self._priced]]
        return np.bincount(used, minlength=len(self.exclusive.keys)).astype(np.float64)

    def _list(self, codes: NDArray[np.int64]) -> None:
        """Look at these travels too from now on, and note which of them pass between sets."""
        known, cost = np.isin(codes, self.codes, assume_unique=True), np.empty((len(codes), 4))
        cost[known] = self._cost
        cost[~known] = travel_costs(self.choices, codes[~known] // self.n, codes[~known] % self.n)
        self.codes, self._cost = codes, cost
        self.arcs = TravelArcs.of(codes, cost, self.n)
        wanted = self.arcs.tails * self.n + self.arcs.heads
        place = np.searchsorted(self.exclusive.keys, wanted)
        self._priced = np.flatnonzero(np.append(self.exclusive.keys, -1)[place] == wanted)
        self._exclusive = place[self._priced]


def _precedence(problem: OrderProblem) -> tuple[PossibleTravels, ExclusiveTravels]:
    """Return the rule for pricing, and the travels to direct successors that it leaves out."""
    graph = problem.graph
    rows = closure_of(graph)
    kept = cover_mask(rows, graph.pred_offsets, graph.preds)
    heads, covers = (
        np.repeat(np.arange(graph.n), np.diff(graph.pred_offsets))[kept],
        graph.preds[kept],
    )
    exclusive = find_exclusive_travels(rows, _offsets(heads, graph.n), covers)
    add_descendants(graph.succ_offsets, graph.succs, rows)
    priced = ~np.isin(covers.astype(np.int64) * graph.n + heads, exclusive.keys)
    rule = PossibleTravels(
        rows, _offsets(heads[priced], graph.n), np.ascontiguousarray(covers[priced], np.int32)
    )
    return rule, exclusive


def _offsets(heads: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum(np.bincount(heads, minlength=n))]).astype(np.int64)
