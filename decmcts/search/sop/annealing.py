"""Annealing of a bare sequence, in slices: how long, how hot, and towards which nodes.

References
----------
Luby, Sinclair & Zuckerman 1993, "Optimal speedup of Las Vegas algorithms".

**By elites**, where costs are no distances. The elites are the best sequences so far. Each
annealing is short and begins hot. The near nodes it draws are those that follow in one of the
elites, and the few cheapest. So steps that all elites share come back soon, and where elites differ
the annealing decides. On problems with few precedences and random costs one long annealing ends
well above this (docs/results/sop_ablation.md).

References
----------
Gambardella & Dorigo 2000 (sequences built from the steps of good ones, then improved);
Applegate, Bixby, Chvátal & Cook 2006, ch. 15.6 (tour merging: best in the union of tours).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s
from decmcts.feasibility.graph import DependencyGraph
from decmcts.random_kernels import below
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.stopping import TemperatureSchedule
from decmcts.search.sop.annealing_kernels import Bare, Shares, anneal_bare

SHARES = Shares(follow=0.7, reverse=0.12)

_STEPS = 100  # temperatures of an annealing
_QUENCH = 0.08  # last share of an annealing, in which the temperature falls fast
_FROZEN = 0.1  # to this share of what it was when that began
_HOT = 1.0  # first temperature, in scales; of the last annealing twice that
_COLD = 0.05  # temperature at the end of the slow cooling, in scales
_COLDER = 0.01  # of every second annealing of the thread with long ones
_SHORTEST = (2_000, 64_000)  # proposals a node: many short annealings on one thread, few long
FIRST = 4_000  # of the first: soon over, and then the pace is known
_ROUND = 15  # annealings until their lengths come again, once to eight times the shortest
_LONGEST = 1_000_000  # proposals a node of the last annealing at most
_LEAST_LAST = 10_000  # and at least, if there is time for so many
ALL = 0.99  # of the budget
_NEAR = 8  # by cost, and as many by reduced cost


@dataclass(frozen=True, slots=True)
class NearSteps:
    """Cheap steps from each node, and how far their costs lie apart: what temperatures go by."""

    near: Int32s  # (n, k) nodes: half by cost, half by reduced cost; -1 padded
    scale: float  # mean cost beyond that of the cheapest, over the k cheapest of each node
    are_distances: bool  # every step that may go both ways costs the same both ways

    @staticmethod
    def of(costs: Floats, reduced: Floats, possible: Flags, *, least: float = 0.0) -> NearSteps:
        """Return those of (n, n) costs; the scale is `least` or more."""
        by_cost = _nearest(costs, possible, 2 * _NEAR)
        near = [by_cost[:, :_NEAR], _nearest(reduced, possible, _NEAR)]
        return NearSteps(
            np.concatenate(near, axis=1),
            max(_mean_excess(costs, by_cost), least),
            bool((costs == costs.T)[possible & possible.T].all()),
        )

    def bare(self, costs: Floats, graph: DependencyGraph) -> Bare:
        """Return what annealing works on: the nodes in order of their numbers."""
        n = len(costs)
        nodes = np.arange(n, dtype=np.int32)
        return Bare(
            costs, self.near,
            graph.pred_offsets, graph.preds, graph.succ_offsets, graph.succs,
            nodes, nodes.copy(), np.empty(n, np.int32),
        )  # fmt: skip


@dataclass(slots=True, kw_only=True)
class Annealer:
    """A sequence that one annealing after the other changes; where the present one stands.

    Subclasses say how hot the present annealing is, and begin the next.
    """

    bare: Bare
    state: NDArray[np.uint64]  # (1,)
    cost: float = np.inf
    best: float = np.inf  # least cost seen where the temperature changes
    length: int = 0  # proposals of the present annealing, 0: as many as the budget allows
    done: int = 0  # proposals made in it
    pace: float = np.inf  # proposals for the whole budget, once known
    _found: Int32s | None = None  # the best, since it was last offered
    _quota: int = 0  # of the slice before
    _spent: float = np.inf  # budget spent when it began

    def work(self, quota: int, spent: float) -> int:
        """Make `quota` proposals, in as many annealings as that takes."""
        if spent > self._spent and quota <= 2 * self._quota:  # else slices still grow
            self.pace = self._quota / (spent - self._spent)
        self._quota, self._spent = quota, spent
        left = quota
        while left > 0:
            left -= self.anneal(self.temperature(spent), left)
            if self.done == self.length:
                self.end(spent)
        return quota

    def temperature(self, spent: float) -> float:
        """Return the temperature at which the present annealing goes on."""
        raise NotImplementedError

    def end(self, spent: float) -> None:
        """Begin the next annealing."""
        raise NotImplementedError

    def anneal(self, temperature: float, most: int) -> int:
        """Make up to `most` proposals at one temperature; return how many."""
        step = most
        if self.length:
            step = min(most, max(self.length // _STEPS, 1), self.length - self.done)
        last = len(self.bare.order) - 1
        self.cost += anneal_bare(self.bare, SHARES, self.state, temperature, step, 0, last)
        self.done += step
        if self.cost < self.best:
            self.best, self._found = self.cost, self.bare.order.copy()
        return step

    def take(self, order: Int32s, cost: float) -> None:
        """Go on from another sequence."""
        self.bare.order[:] = order
        self.bare.position[order] = np.arange(len(order))
        self.cost = cost

    def begin(self, incumbent: Incumbent, first: int) -> None:
        """Go on from the incumbent by an annealing of `first` proposals a node."""
        self.take(incumbent.order, incumbent.cost)
        self.length = first * len(incumbent.order)

    def meet(self, incumbent: Incumbent) -> None:
        """Offer the best found since the last meeting."""
        if self._found is not None:
            incumbent.offer(self._found, incumbent.reversed, by="annealing")
            self._found = None


@dataclass(slots=True, kw_only=True)
class LubyAnnealer(Annealer):
    """Annealing after annealing; each goes on from where the one before ended.

    They are once, twice, four and eight times as long as the shortest, and each length
    gets as much time (Luby's sequence). Small problems need many short ones, large ones
    a long one. So once little of the budget is left for the problem's size, a last, long
    annealing takes `last_share` of it, or more where that would be short for the size.
    """

    scale: float  # of temperatures
    long: bool  # whether its annealings are long ones
    last_share: float = ALL  # 0: no annealing is the last
    first_cost: float = np.inf  # at the end of the first annealing
    _count: int = 0  # annealings ended
    _began: float = 0.0  # budget spent when the last annealing began
    _ends: float = np.inf  # budget spent when it ends

    @property
    def is_last(self) -> bool:
        """Whether the last annealing has begun, which ends at a share of the budget."""
        return self.length == 0 and self._count > 0

    def over(self, spent: float) -> bool:
        """Whether the last annealing has ended."""
        return spent >= self._ends

    def temperature(self, spent: float) -> float:
        """Return the temperature at which the present annealing goes on."""
        hot, cold = _HOT * self.scale, _COLD * self.scale
        if self.length == 0:
            share = (spent - self._began) / max(self._ends - self._began, 1e-9)
            return quenched(TemperatureSchedule(2.0 * hot, cold), share)
        if self.long and self._count & 1:
            cold = _COLDER * self.scale
        return quenched(TemperatureSchedule(hot, cold), self.done / self.length)

    def end(self, spent: float) -> None:
        """Begin the next annealing."""
        n = len(self.bare.order)
        if self._count == 0:
            self.first_cost = self.cost
        self._count, self.done = self._count + 1, 0
        self.length = luby(self._count % _ROUND + 1) * _SHORTEST[self.long] * n
        left = self.pace * (1.0 - spent)
        if self.last_share and left < max(_LONGEST * n, self.length):
            self.length, self._began = 0, spent
            share = max(self.last_share, min(_LEAST_LAST * n / max(left, 1.0), ALL))
            self._ends = spent + share * (1.0 - spent)


def quenched(schedule: TemperatureSchedule, share: float) -> float:
    """Return the temperature after `share` (0..1) of an annealing that ends with a quench."""
    slow = min(share / (1.0 - _QUENCH), 1.0)
    return schedule.at(slow) * float(_FROZEN ** min(max(share - 1.0 + _QUENCH, 0.0) / _QUENCH, 1.0))


def luby(k: int) -> int:
    """Return the k-th number, from 1, of Luby, Sinclair & Zuckerman's: 1, 1, 2, 1, 1, 2, 4."""
    while (k + 1) & k:
        k -= (1 << (k.bit_length() - 1)) - 1
    return (k + 1) >> 1


def _nearest(costs: Floats, possible: Flags, width: int) -> Int32s:
    """Return the cheapest possible successors of each node, cheapest first; -1 padded."""
    table = np.where(possible, costs, np.inf)
    nodes = np.argsort(table, axis=1, kind="stable")[:, :width]
    there = np.isfinite(np.take_along_axis(table, nodes, axis=1))
    return np.where(there, nodes, -1).astype(np.int32)


def _mean_excess(costs: Floats, near: Int32s) -> float:
    """Return how much more steps to near nodes cost than the cheapest of them, in the mean."""
    there = near >= 0
    found = np.take_along_axis(costs, np.maximum(near, 0), axis=1)
    return float((found - found[:, :1])[there].sum()) / max(int(there.sum()), 1)


_ELITES = 8

_CHEAPEST = 2  # near steps by cost and by reduced cost beside those of the elites
_ELITE_HOT, _ELITE_COLD = 2.0, 0.05  # temperatures, in scales
_LENGTH = (4_000, 30_000)  # proposals a node: short annealings on one thread, long on the other
LEAST = 2_000  # where time allows no more
_ANNEALINGS = 60  # so many should fit into the budget
_STALE = 3 * _ELITES  # annealings in a row that find no elite


@dataclass(slots=True)
class Elites:
    """The best sequences, all of different cost."""

    most: int
    costs: list[float] = field(default_factory=list)
    orders: list[Int32s] = field(default_factory=list)

    @property
    def full(self) -> bool:
        """Whether a new one takes another's place."""
        return len(self.costs) == self.most

    def add(self, cost: float, order: Int32s, *, least_gain: float) -> bool:
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

    def following(self) -> Int32s:
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
        schedule = TemperatureSchedule(
            _ELITE_HOT * self.steps.scale, _ELITE_COLD * self.steps.scale
        )
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

    def _near(self) -> Int32s:
        """Return (n, k) nodes that may follow: those that do in elites, and the cheapest."""
        near, half = self.steps.near, self.steps.near.shape[1] // 2
        cheapest = (near[:, :_CHEAPEST], near[:, half : half + _CHEAPEST])
        return np.concatenate([self._elites.following(), *cheapest], axis=1)
