"""The relaxation behind the certificate: arborescences of travels at prices.

Why its value is a bound is proved in `decmcts.search.certificate`, which also
looks for good prices. The arithmetic of prices lives in `decmcts._kernels.pricing`,
sets that must be left often in `decmcts.search.crossings`, travels of
which an order uses one in `decmcts.search.passages`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.arborescence import cheapest_arborescence
from decmcts._kernels.pricing import (
    WORD,
    Places,
    Precedence,
    Prices,
    add_descendants,
    arc_weights,
    bound_words,
    cover_mask,
    price_travels,
)
from decmcts.feasibility.build import closure_of
from decmcts.search.crossings import Crossings, forced_crossings
from decmcts.search.passages import Passages, single_passages
from decmcts.search.problem import OrderProblem

WIDTH = 8  # travels taken up per entry port and pricing
ROUNDING = 1e-9  # of the largest number, times n: what a value is lowered by; see `evaluate`


@dataclass(frozen=True, slots=True)
class Arcs:
    """Travels that are looked at, by the contour they lead to; the root's exit port is 2n."""

    offsets: NDArray[np.int64]  # (n + 1,)
    exits: NDArray[np.int64]  # (m,) port
    entries: NDArray[np.int64]  # (m,) port

    @staticmethod
    def of(codes: NDArray[np.int64], n: int) -> Arcs:
        """Sort distinct arcs, each coded as exit · 2n + entry, by their head."""
        exits, entries = codes // (2 * n), codes % (2 * n)
        order = np.argsort(entries >> 1, kind="stable")
        count = np.bincount(entries >> 1, minlength=n)
        offsets = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
        return Arcs(offsets, exits[order], entries[order])


@dataclass(frozen=True, slots=True)
class Relaxed:
    """The value of the relaxation at some prices, and how to raise it."""

    value: float  # mm
    slope: NDArray[np.float64]  # as the multipliers
    rounding: float  # what rounding added to the value at the very most, mm


class Relaxation:
    """Arborescences with a way back to the root, at prices: see `ascend`.

    Multipliers are one vector: to leave each contour and the root (n + 1), for the
    directions (n), for the sets (s), for the passages (p).
    """

    def __init__(self, problem: OrderProblem) -> None:
        self.n = len(problem)
        self.problem = problem
        self.places = _places(problem)
        self.rule, self.passages = _precedence(problem)
        self.crossings: Crossings = forced_crossings(problem)
        graph = problem.graph
        self.first = np.flatnonzero(np.diff(graph.pred_offsets) == 0)
        self.last = np.flatnonzero(np.diff(graph.succ_offsets) == 0)
        self._list(np.union1d(self._root_codes(), self._passage_codes()))
        self.escape = np.full(self.n, np.inf)
        ports = self.places.ports
        self.reach = float(np.linalg.norm(ports.max(axis=0) - ports.min(axis=0)))

    @property
    def size(self) -> int:
        """Number of multipliers."""
        return 2 * self.n + 1 + len(self.crossings.exits) + self.passages.count

    @property
    def _sets(self) -> slice:
        return slice(2 * self.n + 1, 2 * self.n + 1 + len(self.crossings.exits))

    @property
    def _passes(self) -> slice:
        return slice(self._sets.stop, None)

    def prices(self, at: NDArray[np.float64]) -> Prices:
        """Return the multipliers, but those for passages, as prices of travels."""
        n, member = self.n, self.crossings.member
        refund = (member * at[self._sets]) @ (~member).T.astype(np.float64)
        return Prices(
            at[: n + 1], at[n + 1 : 2 * n + 1], self.crossings.zone, np.ascontiguousarray(refund)
        )

    def allowed(self, at: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the nearest multipliers that keep the value a bound."""
        sets = 2 * self.n + 1
        return np.concatenate([at[:sets], np.maximum(at[sets:], 0.0)])

    def take_up(self, at: NDArray[np.float64]) -> None:
        """Add the travels that are cheapest at these prices; bound what is left out.

        After this `evaluate` at the same multipliers is a valid bound.
        """
        exits, self.escape = price_travels(self.places, self.rule, self.prices(at), WIDTH)
        entries = np.broadcast_to(np.arange(2 * self.n)[:, None], exits.shape)
        new = (exits * (2 * self.n) + entries)[exits >= 0]
        self._list(np.union1d(self.codes, new))

    def evaluate(self, at: NDArray[np.float64]) -> Relaxed:
        """Return the relaxation's value at some multipliers.

        No key of the heaps exceeds twice the largest price M, and each undergoes at
        most n subtractions, so rounding makes the arborescence too dear by no more
        than some 4 n² · 1.1e-16 · M. `ROUNDING` covers that up to a million contours.
        """
        n, arcs = self.n, self.arcs
        prices = self.prices(at)
        weight = np.empty(len(arcs.exits) + n)
        weight[len(arcs.exits) :] = self.escape
        arc_weights(arcs.exits, arcs.entries, self.places, prices, weight[: len(arcs.exits)])
        tolls = self.passages.of @ at[self._passes]
        weight[self._passing] += tolls[self._passage]
        chosen = cheapest_arborescence(
            arcs.offsets, arcs.exits >> 1, weight[: len(arcs.exits)], self.escape
        )
        back = prices.leave[self.last] - np.abs(prices.turn[self.last])
        home = int(np.argmin(back))
        value = weight[chosen].sum() + back[home] - prices.leave.sum()
        value += at[self._sets] @ self.crossings.exits - at[self._passes].sum()
        largest = self.reach + 4.0 * np.abs(at).max() + prices.crossing.max()
        largest += tolls.max(initial=0.0) + at[self._passes].sum() / n
        slope = self._slope(prices, chosen[chosen < len(arcs.exits)], int(self.last[home]))
        return Relaxed(float(value), slope, ROUNDING * n * float(largest))

    def _slope(self, prices: Prices, chosen: NDArray[np.int64], home: int) -> NDArray[np.float64]:
        """Return the subgradient: how far the arborescence is from a path."""
        n = self.n
        exits, entries = self.arcs.exits[chosen], self.arcs.entries[chosen]
        slope = np.zeros(self.size)
        slope[: n + 1] = np.bincount(exits >> 1, minlength=n + 1) - 1.0
        slope[home] += 1.0
        real = exits < 2 * n
        tails, heads = exits[real] >> 1, entries[real] >> 1
        turn = np.zeros(n)
        np.add.at(turn, tails, np.where(exits[real] & 1, 1.0, -1.0))
        np.add.at(turn, entries >> 1, np.where(entries & 1, 1.0, -1.0))
        turn[home] -= np.sign(prices.turn[home])
        slope[n + 1 : 2 * n + 1] = np.where(self.places.turns, turn, 0.0)
        zone, member = self.crossings.zone, self.crossings.member
        leaving = member[zone[tails]] & ~member[zone[heads]]
        slope[self._sets] = self.crossings.exits - leaving.sum(axis=0)
        slope[self._passes] = self.passages.of.T @ self._used(chosen) - 1.0
        return slope

    def _used(self, chosen: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return how often each travel that passes is used."""
        is_chosen = np.zeros(len(self.arcs.exits), np.bool_)
        is_chosen[chosen] = True
        used = self._passage[is_chosen[self._passing]]
        return np.bincount(used, minlength=len(self.passages.keys)).astype(np.float64)

    def _list(self, codes: NDArray[np.int64]) -> None:
        """Look at these travels from now on, and note which of them pass between sets."""
        self.codes, self.arcs = codes, Arcs.of(codes, self.n)
        wanted = (self.arcs.exits >> 1) * self.n + (self.arcs.entries >> 1)
        place = np.searchsorted(self.passages.keys, wanted)
        self._passing = np.flatnonzero(np.append(self.passages.keys, -1)[place] == wanted)
        self._passage = place[self._passing]

    def _passage_codes(self) -> NDArray[np.int64]:
        """Return all travels that pass; pricing leaves them out."""
        tails, heads = self.passages.keys // self.n, self.passages.keys % self.n
        turns = self.places.turns
        codes = []
        for leave, enter in ((1, 0), (1, 1), (0, 0), (0, 1)):  # port 2c + 1 ends c as sliced
            may = (turns[tails] | (leave == 1)) & (turns[heads] | (enter == 0))
            codes.append((2 * tails[may] + leave) * (2 * self.n) + 2 * heads[may] + enter)
        return np.concatenate(codes)

    def _root_codes(self) -> NDArray[np.int64]:
        turning = self.first[self.places.turns[self.first]]
        entries = np.concatenate([2 * self.first, 2 * turning + 1])
        return np.unique(2 * self.n * (2 * self.n) + entries)


def _places(problem: OrderProblem) -> Places:
    boxes = np.empty((-(-len(problem) // WORD), 6))
    places = Places(problem.ports(), problem.reversible, boxes)
    bound_words(places)
    return places


def _precedence(problem: OrderProblem) -> tuple[Precedence, Passages]:
    """Return the rule for pricing, and the travels to direct successors that it leaves out."""
    graph = problem.graph
    rows = closure_of(graph)
    kept = cover_mask(rows, graph.pred_offsets, graph.preds)
    heads, covers = (
        np.repeat(np.arange(graph.n), np.diff(graph.pred_offsets))[kept],
        graph.preds[kept],
    )
    passages = single_passages(rows, _offsets(heads, graph.n), covers)
    add_descendants(graph.succ_offsets, graph.succs, rows)
    priced = ~np.isin(covers.astype(np.int64) * graph.n + heads, passages.keys)
    rule = Precedence(
        rows, _offsets(heads[priced], graph.n), np.ascontiguousarray(covers[priced], np.int32)
    )
    return rule, passages


def _offsets(heads: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum(np.bincount(heads, minlength=n))]).astype(np.int64)
