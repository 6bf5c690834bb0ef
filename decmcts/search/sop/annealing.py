"""Annealing of a bare sequence, in slices: how long, how hot, and towards which nodes.

References
----------
Luby, Sinclair & Zuckerman 1993, "Optimal speedup of Las Vegas algorithms".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.sequence.bare import Bare, Shares, anneal_bare
from decmcts.feasibility.graph import DependencyGraph
from decmcts.search.sequence.annealing import TemperatureSchedule
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sop.found import offer

NAME = "annealing"
STEPS = 100  # temperatures of an annealing
SHARES = Shares(follow=0.49, reverse=0.08, hop=0.3)

_QUENCH = 0.08  # last share of an annealing, in which the temperature falls fast
_FROZEN = 0.1  # to this share of what it was when that began
_HOT = 1.0  # first temperature, in scales; of the last annealing twice that
_COLD = 0.05  # temperature at the end of the slow cooling, in scales
_COLDER = 0.01  # of every second annealing of the thread with long ones
_SHORTEST = (2_000, 64_000)  # proposals a node: many short annealings on one thread, few long
_FIRST = 4_000  # of the first: soon over, and then the pace is known
_ROUND = 15  # annealings until their lengths come again, once to eight times the shortest
_LONGEST = 1_000_000  # proposals a node of the last annealing, which gets what is left
_LAST_ENDS = 0.99  # share of the budget
_NEAR = 8  # by cost, and as many by reduced cost


@dataclass(frozen=True, slots=True)
class NearSteps:
    """Cheap steps from each node, and how far their costs lie apart: what temperatures go by."""

    near: NDArray[np.int32]  # (n, k) nodes: half by cost, half by reduced cost; -1 padded
    hop_cost: NDArray[np.float64]  # (n,) a step that costs more is longer than to any near node
    scale: float  # mean cost beyond that of the cheapest, over the k cheapest of each node
    are_distances: bool  # every step that may go both ways costs the same both ways

    @staticmethod
    def of(
        costs: NDArray[np.float64],
        reduced: NDArray[np.float64],
        possible: NDArray[np.bool_],
        *,
        least: float = 0.0,
    ) -> NearSteps:
        """Return those of (n, n) costs; the scale is `least` or more."""
        by_cost, excess = _nearest(costs, possible, 2 * _NEAR)
        by_reduced, _ = _nearest(reduced, possible, _NEAR)
        last = by_cost[:, min(_NEAR, by_cost.shape[1]) - 1]
        nodes = np.arange(len(costs))
        return NearSteps(
            np.concatenate([by_cost[:, :_NEAR], by_reduced], axis=1),
            np.where(last >= 0, costs[nodes, last], np.inf),
            max(excess, least),
            bool((costs == costs.T)[possible & possible.T].all()),
        )

    def bare(self, costs: NDArray[np.float64], graph: DependencyGraph) -> Bare:
        """Return what annealing works on: the nodes in order of their numbers."""
        n = len(costs)
        nodes = np.arange(n, dtype=np.int32)
        return Bare(
            costs, self.near, self.hop_cost,
            graph.pred_offsets, graph.preds, graph.succ_offsets, graph.succs,
            nodes, nodes.copy(), np.empty(n, np.int32), np.empty(n, np.int32),
        )  # fmt: skip


@dataclass(slots=True)
class AnnealThread:
    """Annealing after annealing; each goes on from where the one before ended.

    They are once, twice, four and eight times as long as the shortest, and each length
    gets as much time (Luby's sequence). Small problems need many short ones, large ones
    a long one. So once little of the budget is left for the problem's size, a last
    annealing takes all of it (`ends_long`).
    """

    bare: Bare
    shares: Shares
    scale: float  # of temperatures
    state: NDArray[np.uint64]  # (1,)
    long: bool  # whether its annealings are long ones
    ends_long: bool = True  # whether a last annealing takes what is left of the budget
    best: float = np.inf  # least cost seen where the temperature changes
    first_cost: float = np.inf  # at the end of the first annealing
    _cost: float = np.inf
    _found: NDArray[np.int32] | None = None  # since the last meeting
    _count: int = 0  # annealings ended
    _length: int = 0  # proposals of the present one, 0: as many as the budget allows
    _done: int = 0  # proposals made in it
    _began: float = 0.0  # budget spent when the last annealing began
    _quota: int = 0  # of the slice before
    _spent: float = np.inf  # budget spent when it began
    _pace: float = np.inf  # proposals for the whole budget, once known

    def work(self, quota: int, spent: float) -> int:
        """Make `quota` proposals, in as many annealings as that takes."""
        if spent > self._spent and quota <= 2 * self._quota:  # else slices still grow
            self._pace = self._quota / (spent - self._spent)
        left, self._quota, self._spent = quota, quota, spent
        while left > 0:
            share = (spent - self._began) / max(_LAST_ENDS - self._began, 1e-9)
            step = left
            if self._length:
                step = min(left, max(self._length // STEPS, 1), self._length - self._done)
                share = self._done / self._length
            self._cost += anneal_bare(
                self.bare, self.shares, self.state, self._temperature(share), step
            )
            self._done += step
            left -= step
            if self._cost < self.best:
                self.best, self._found = self._cost, self.bare.order.copy()
            if self._done == self._length:
                self._end(spent)
        return quota

    @property
    def is_last(self) -> bool:
        """Whether the last annealing has begun, which takes what is left of the budget."""
        return self._length == 0 and self._count > 0

    def _temperature(self, share: float) -> float:
        """Return the temperature after `share` (0..1) of the present annealing."""
        hot, cold = _HOT if self._length else 2.0 * _HOT, _COLD
        if self._length and self.long and self._count & 1:
            cold = _COLDER
        return quenched(TemperatureSchedule(hot * self.scale, cold * self.scale), share)

    def meet(self, incumbent: Incumbent) -> None:
        """Offer the best sequence seen since the last meeting."""
        if self._cost == np.inf:
            begin_with(self.bare, incumbent.order)
            self._cost, self._length = incumbent.cost, _FIRST * len(self.bare.order)
        if self._found is not None:
            offer(incumbent, self._found, NAME)
            self._found = None

    def _end(self, spent: float) -> None:
        """Begin the next annealing."""
        if self._count == 0:
            self.first_cost = self._cost
        self._count, self._done = self._count + 1, 0
        self._length = luby(self._count % _ROUND + 1) * _SHORTEST[self.long] * len(self.bare.order)
        if self.ends_long and self._pace * (1.0 - spent) < max(
            _LONGEST * len(self.bare.order), self._length
        ):
            self._length, self._began = 0, spent


def quenched(schedule: TemperatureSchedule, share: float) -> float:
    """Return the temperature after `share` (0..1) of an annealing that ends with a quench."""
    slow = min(share / (1.0 - _QUENCH), 1.0)
    return schedule.at(slow) * float(_FROZEN ** min(max(share - 1.0 + _QUENCH, 0.0) / _QUENCH, 1.0))


def begin_with(bare: Bare, order: NDArray[np.int32]) -> None:
    """Take over a sequence."""
    bare.order[:] = order
    bare.position[order] = np.arange(len(order))


def luby(k: int) -> int:
    """Return the k-th number, from 1, of Luby, Sinclair & Zuckerman's: 1, 1, 2, 1, 1, 2, 4."""
    while (k + 1) & k:
        k -= (1 << (k.bit_length() - 1)) - 1
    return (k + 1) >> 1


def _nearest(
    costs: NDArray[np.float64], possible: NDArray[np.bool_], width: int
) -> tuple[NDArray[np.int32], float]:
    """Return the cheapest possible successors of each node, cheapest first, and the mean excess."""
    table = np.where(possible, costs, np.inf)
    nodes = np.argsort(table, axis=1, kind="stable")[:, :width]
    found = np.take_along_axis(table, nodes, axis=1)
    there = np.isfinite(found)
    least = np.where(there[:, :1], found[:, :1], 0.0)
    excess = float((found - least)[there].sum())
    return np.where(there, nodes, -1).astype(np.int32), excess / max(int(there.sum()), 1)
