"""The relaxation behind the certificate: arborescences of travels at prices.

Why its value is a bound is proved in `decmcts.search.bounds.certificate`, which also
looks for good prices. The arithmetic of prices lives in `decmcts.search.bounds.pricing_kernels`,
travels of which an order uses one in `decmcts.search.bounds.exclusive_travels`.

Here too are the choices for each contour of a problem, with the points they begin and end at,
and the sets of contours that every order must leave several times (`crossings`): where towers
stand so near each other that the head must print them in turn, it must travel between them
again and again. Bounds that look at single travels miss that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from decmcts.arrays import Flags, Floats, Ints
from decmcts.feasibility.build import closure_of
from decmcts.search.bounds.arborescence_kernels import cheapest_arborescence
from decmcts.search.bounds.chains_kernels import most_exits
from decmcts.search.bounds.exclusive_travels import ExclusiveTravels, find_exclusive_travels
from decmcts.search.bounds.pricing_kernels import (
    WORD,
    Boxes,
    Choices,
    PossibleTravels,
    Prices,
    add_descendants,
    arc_weights,
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

    offsets: Ints  # (n + 1,)
    tails: Ints  # (m,)
    heads: Ints  # (m,)
    cost: Floats  # (m, 4) without prices, from either choice to either choice

    @staticmethod
    def of(codes: Ints, cost: Floats, n: int) -> TravelArcs:
        """Sort distinct arcs, each coded as tail · n + head, by their head."""
        tails, heads = codes // n, codes % n
        order = np.argsort(heads, kind="stable")
        offsets = np.concatenate([[0], np.cumsum(np.bincount(heads, minlength=n))])
        return TravelArcs(offsets.astype(np.int64), tails[order], heads[order], cost[order])


@dataclass(frozen=True, slots=True)
class Relaxed:
    """The value of the relaxation at some prices, and how to raise it."""

    value: float  # in the metric's unit
    slope: Floats  # as the multipliers
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
        first = self.choices.pairs[self.choices.offsets[:-1]]
        ends = points[self.choices.into], points[self.choices.out]
        enter, leave = (_boxes_of(each, each, first) for each in ends)
        words = _boxes_of(leave[:, :3], leave[:, 3:], np.arange(0, n, WORD))
        self.boxes = Boxes(enter, leave, words)
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

    def prices(self, at: Floats) -> Prices:
        """Return the multipliers, but those for exclusive travels, as prices of travels."""
        member = self.crossings.member
        refund = (member * at[self._sets]) @ (~member).T.astype(np.float64)
        return Prices(
            at[: self.n + 1], at[self._by_choice], self.crossings.zone, np.ascontiguousarray(refund)
        )

    def allowed(self, at: Floats) -> Floats:
        """Return the nearest multipliers that keep the value a bound."""
        free = self._by_choice.stop
        return np.concatenate([at[:free], np.maximum(at[free:], 0.0)])

    def take_up(self, at: Floats) -> None:
        """Add the travels that are cheapest at these prices; bound what is left out.

        After this `evaluate` at the same multipliers is a valid bound.
        """
        prices = self.prices(at)
        tails, self.escape = price_travels(self.choices, self.boxes, self.rule, prices, self._width)
        heads = np.broadcast_to(np.arange(self.n)[:, None], tails.shape)
        self._list(np.union1d(self.codes, (tails * self.n + heads)[tails >= 0]))

    def evaluate(self, at: Floats) -> Relaxed:
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

    def _slope(self, prices: Prices, chosen: Ints, home: int) -> Floats:
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

    def _used(self, chosen: Ints) -> Floats:
        """Return how often each travel that passes is used."""
        is_chosen = np.zeros(len(self.codes), np.bool_)
        is_chosen[chosen] = True
        used = self._exclusive[is_chosen[self._priced]]
        return np.bincount(used, minlength=len(self.exclusive.keys)).astype(np.float64)

    def _list(self, codes: Ints) -> None:
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


def _boxes_of(low: Floats, high: Floats, starts: Ints) -> Floats:
    """Return the bounds in space of runs that begin at `starts`, (k, 6)."""
    bounds = (np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts))
    return np.concatenate(bounds, axis=1)


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


def _offsets(heads: Ints, n: int) -> Ints:
    return np.concatenate([[0], np.cumsum(np.bincount(heads, minlength=n))]).astype(np.int64)


def choices_of(problem: OrderProblem, *, apart: bool = False) -> Choices:
    """Return the choices for each contour, one or two: as sliced or reversed; loops by any entry.

    With `apart` each entry of a loop is a choice of its own. Prices for them would raise
    bounds of the relaxation by some two per cent, and a step would take three times as long.
    """
    n, seams = len(problem), problem.seams
    entries = np.ones(n, np.int64) if seams is None else np.diff(seams.offsets)
    count = np.where(entries > 1, entries, 1 + problem.reversible)
    owner = np.repeat(np.arange(n), count)
    first = np.cumsum(count) - count
    place = np.arange(len(owner)) - first[owner]  # 1: reversed, of those that may be reversed
    into, out = 2 * owner + place, 2 * owner + 1 - place
    if seams is not None:
        chosen = entries[owner] > 1
        into[chosen] = 2 * (n + seams.offsets[owner] + place)[chosen]
        out[chosen] = into[chosen] + 1
    begins = np.flatnonzero((place == 0) | (entries[owner] == 1) | apart)
    choices = np.searchsorted(begins, np.append(first, len(owner)))
    pairs = np.append(begins, len(owner)).astype(np.int64)
    return Choices(problem.metric(), choices.astype(np.int64), pairs, into, out)


GAPS_MM = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
MOST_ZONES = 256
MOST_SQUARES = 4_000_000


@dataclass(frozen=True, slots=True)
class Crossings:
    """Sets as unions of zones, and how often at least any order leaves each.

    A travel leaves a set when it leads from a contour in it to one outside.
    """

    zone: Ints  # (n,) zone of each contour
    member: Flags  # (zones, sets) whether the zone belongs to the set
    exits: Floats  # (sets,) travels that leave the set, at least


def forced_crossings(problem: OrderProblem, *, most: int = 60) -> Crossings:
    """Return up to `most` sets of contours that stand apart and must be left several times.

    The bound on exits of a set S is the largest number of steps from S to outside
    along any chain of the graph. It holds: a linear extension visits the members of
    a chain in their order, so between two that follow each other in the chain, one
    in S and one not, it travels at least once from S to outside; these steps of
    the order are disjoint.
    """
    n = len(problem)
    found: list[tuple[float, float, Flags]] = []
    for gap in GAPS_MM:
        if np.prod(np.ptp(problem.ports()[:, :2], axis=0) // gap + 1.0) > MOST_SQUARES:
            continue
        groups = _apart(problem, gap)
        count = int(groups.max()) + 1
        if not 1 < count <= MOST_ZONES:
            continue
        for group in range(count):
            inside = groups == group
            exits = most_exits(problem.graph.pred_offsets, problem.graph.preds, inside)
            if exits > 1:
                found.append((exits * gap, float(exits), inside))
    found.sort(key=lambda entry: -entry[0])
    return _zoned(n, _distinct(found)[:most])


def _distinct(found: list[tuple[float, float, Flags]]) -> list[tuple[float, Flags]]:
    """Return exits and members of each set once."""
    once = {inside.tobytes(): (exits, inside) for _, exits, inside in reversed(found)}
    return list(reversed(once.values()))


def _zoned(n: int, sets: list[tuple[float, Flags]]) -> Crossings:
    if not sets:
        return Crossings(np.zeros(n, np.int64), np.zeros((1, 0), np.bool_), np.zeros(0))
    of = np.stack([inside for _, inside in sets], axis=1)
    member, zone = np.unique(of, axis=0, return_inverse=True)
    exits = np.array([exits for exits, _ in sets])
    return Crossings(np.ascontiguousarray(zone.reshape(n), np.int64), member, exits)


def _apart(problem: OrderProblem, gap: float) -> Ints:
    """Return groups of contours whose ends fall into squares of `gap` that touch, from above."""
    from scipy.ndimage import label  # takes long to load

    xy = problem.ports()[:, :2]
    cells = ((xy - xy.min(axis=0)) // gap).astype(np.int64)
    occupied = np.zeros(cells.max(axis=0) + 1, np.bool_)
    occupied[cells[:, 0], cells[:, 1]] = True
    patch = label(occupied, structure=np.ones((3, 3)))[0][cells[:, 0], cells[:, 1]]
    one, other = patch[0::2], patch[1::2]  # a contour joins the patches of its ends
    size = int(patch.max()) + 1
    links = coo_matrix((np.ones(len(one)), (one, other)), (size, size))
    joined = connected_components(links, directed=False)[1][one]
    return np.unique(joined, return_inverse=True)[1].astype(np.int64)
