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
from decmcts.search.sequence.annealing import TemperatureSchedule
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sop.found import offer

_HOT = 1.0  # first temperature, in scales; of the last annealing twice that
_COLD = 0.05  # temperature at the end of the slow cooling, in scales
_COLDER = 0.01  # of every second annealing of the thread with long ones
_WARM = (1.0, 0.3, 2.0)  # first temperatures of warm annealings in turn, in reduced scales
_WARM_SHARE = 0.25  # of what is left
_QUENCH = 0.08  # last share of an annealing, in which the temperature falls fast,
_FROZEN = 0.1  # to this share of the last temperature
_TEMPERATURES = 100  # of an annealing
_SHORTEST = (2_000, 64_000)  # proposals a node: many short annealings on one thread, few long
_FIRST = 4_000  # of the first: soon over, and then the pace is known
_ROUND = 15  # annealings until their lengths come again, once to eight times the shortest
_LONGEST = 1_000_000  # proposals a node of the last annealing, which gets what is left
_LAST_ENDS = 0.99  # share of the budget
_SHARES = Shares(follow=0.7, reverse=0.12)
_NEAR = 8  # by cost, and as many by reduced cost


@dataclass(frozen=True, slots=True)
class NearSteps:
    """Cheap steps from each node, and how far their costs lie apart: what temperatures go by."""

    near: NDArray[np.int32]  # (n, k) nodes: half by cost, half by reduced cost; -1 padded
    scale: float  # mean cost beyond that of the cheapest, over the k cheapest of each node
    reduced_scale: float  # likewise, by reduced cost
    are_distances: bool  # every step that may go both ways costs the same both ways

    @staticmethod
    def of(
        costs: NDArray[np.float64],
        reduced: NDArray[np.float64],
        possible: NDArray[np.bool_],
        *,
        least: float = 0.0,
    ) -> NearSteps:
        """Return those of (n, n) costs; scales are `least` or more."""
        by_cost, scale = _nearest(costs, possible, 2 * _NEAR)
        by_reduced, reduced_scale = _nearest(reduced, possible, 2 * _NEAR)
        return NearSteps(
            np.concatenate([by_cost[:, :_NEAR], by_reduced[:, :_NEAR]], axis=1),
            max(scale, least),
            max(reduced_scale, least),
            bool((costs == costs.T)[possible & possible.T].all()),
        )


@dataclass(slots=True)
class AnnealThread:
    """Annealing after annealing; each goes on from where the one before ended.

    They are once, twice, four and eight times as long as the shortest, and each length
    gets as much time (Luby's sequence). Small problems need many short ones, large ones
    a long one: what is left, once it is little for the size, goes to a last one.
    Where costs are no distances beams find more than a long one, so in its place come
    warm ones: each begins with the best sequence known and changes it little.
    """

    bare: Bare
    steps: NearSteps
    state: NDArray[np.uint64]  # (1,)
    long: bool  # whether its annealings are long ones
    name: str = "annealing"
    best: float = np.inf  # least cost seen where the temperature changes
    promise: float = np.inf  # cost at the end of the first annealing
    warm: bool = False  # whether each annealing begins with the best sequence known
    _cost: float = np.inf
    _found: NDArray[np.int32] | None = None  # since the last meeting
    _count: int = 0  # annealings ended
    _anew: bool = False  # whether to begin with the best sequence at the next meeting
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
                step = min(left, max(self._length // _TEMPERATURES, 1), self._length - self._done)
                share = self._done / self._length
            self._cost += anneal_bare(
                self.bare, _SHARES, self.state, self._temperature(share), step
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
        hot, cold, scale = _HOT if self._length else 2.0 * _HOT, _COLD, self.steps.scale
        if self.warm:
            hot, cold, scale = _WARM[self._count % len(_WARM)], _COLDER, self.steps.reduced_scale
        elif self._length and self.long and self._count & 1:
            cold = _COLDER
        slow = min(share / (1.0 - _QUENCH), 1.0)
        temperature = TemperatureSchedule(hot * scale, cold * scale).at(slow)
        quenched = max(share - 1.0 + _QUENCH, 0.0) / _QUENCH
        return temperature * float(_FROZEN ** min(quenched, 1.0))

    def meet(self, incumbent: Incumbent) -> None:
        """Offer the best sequence seen since the last meeting."""
        if self._cost == np.inf:
            self._take(incumbent)
            self._length = _FIRST * len(self.bare.order)
        if self._found is not None:
            offer(incumbent, self._found, self.name)
            self._found = None
        if self.is_last and not self.steps.are_distances:
            self.warm = self._anew = True
        if self._anew:
            self._take(incumbent)
            self._length = self._warm_length(incumbent.spent)
            self._anew = False

    def _warm_length(self, spent: float) -> int:
        """Return the proposals of a warm annealing: a share of those that are left, if known."""
        n = len(self.bare.order)
        if self._pace == np.inf:
            return _FIRST * n
        return max(int(_WARM_SHARE * self._pace * (1.0 - spent)), n)

    def _take(self, incumbent: Incumbent) -> None:
        """Take over the best sequence known."""
        self.bare.order[:] = incumbent.order
        self.bare.position[incumbent.order] = np.arange(len(incumbent.order))
        self._cost, self._done = incumbent.cost, 0

    def _end(self, spent: float) -> None:
        """Begin the next annealing."""
        if self._count == 0:
            self.promise = self._cost
        self._count, self._done, self._anew = self._count + 1, 0, self.warm
        self._length = luby(self._count % _ROUND + 1) * _SHORTEST[self.long] * len(self.bare.order)
        if not self.warm and self._pace * (1.0 - spent) < max(
            _LONGEST * len(self.bare.order), self._length
        ):
            self._length, self._began = 0, spent


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
