"""Other planners for several heads, in one process: what benchmarks compare Dec-MCTS with.

*Policies*: list scheduling without plans of heads, by the best of the planner's own policies, then
by random ones like them. *Annealing*, of the joint order: it says of every contour which head
prints it, from which end and at which turn among all. It begins as the best of 128 policies, or as
the order heads begin with. A move takes a run of one head's contours and gives it to another head,
or another turn that precedence allows, or both; every order is evaluated in full by the engine.

References
----------
Graham 1966, "Bounds for certain multiprocessing anomalies", Bell System Technical Journal 45(9).
Kirkpatrick, Gelatt & Vecchi 1983, "Optimization by simulated annealing", Science
220(4598), 671-680.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.toolpath import Toolpath
from decmcts.team.dec_mcts.planner import ENOUGH, FAR
from decmcts.team.engine.dispatch_kernels import URGENCY, dispatch
from decmcts.team.engine.joint_kernels import Units
from decmcts.team.engine.order import refuse, units_of
from decmcts.team.engine.plans import POLICIES, STEP, StatedOrder
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import keys_of, policy_of
from decmcts.team.incumbent import Budget, Found, TeamIncumbent

HOT, COLD = 1e-3, 1e-5  # temperatures at first and at last, shares of the makespan
FIRST = 128  # policies tried at first
LONGEST = 0.1  # run of contours, share of a head's
SPREAD = 0.5  # of the logarithm of a random policy's weights, standard deviation

Floats = NDArray[np.float64]
Ids = NDArray[np.int64]


class Placed(TeamIncumbent):
    """The best joint order so far, of orders as the engine places them."""

    @property
    def ended(self) -> bool:
        """Whether the budget is spent."""
        return self.orders > 0 and self._budget.stopping.ends(self.seconds, self.orders)

    @property
    def share(self) -> float:
        """Share of the budget that is spent, 0..1."""
        return min(1.0, self._budget.stopping.spent(self.seconds, self.orders))

    def offer(self, units: Units) -> float:
        """Keep the order that units were placed in if it is the best; returns its makespan."""
        makespan = float(units.end[: int(units.used[0])].max(initial=0.0))
        is_better = makespan < self.makespan_s
        heads = len(self.problem.machine.heads)
        paths = stated_of(units).toolpaths(heads) if is_better else ()
        self.offer_toolpaths(paths, makespan)
        return makespan


def stated_of(units: Units) -> StatedOrder:
    """Return the joint order in which units were placed."""
    used = int(units.used[0])
    row = np.flatnonzero(units.contour[:used] >= 0)
    head = units.head[row].astype(np.int64)
    return StatedOrder(units.contour[row].astype(np.int32), units.reversed[row], head)


def dispatched(problem: TeamProblem, weights: Floats) -> Units:
    """Dispatch by these weights, (heads, 6)."""
    policy = policy_of(problem, weights, keys_of(problem, weights), problem.space.eligible)
    units, verdict = dispatch(problem.visits, problem.fleet, policy)
    refuse(verdict, problem.machine)
    return units


def nth_weights(k: int, heads: int, rng: np.random.Generator) -> Floats:
    """Return row k of `POLICIES` for all heads; after the last, one of them with random changes."""
    if k < len(POLICIES):
        return np.repeat(POLICIES[k][None], heads, axis=0)
    row = POLICIES[int(rng.integers(len(POLICIES)))].copy()
    row[: STEP + 1] *= np.exp(rng.normal(0.0, SPREAD, STEP + 1))
    row[URGENCY] = rng.uniform()
    return np.repeat(row[None], heads, axis=0)


def policies(problem: TeamProblem, budget: Budget, *, seed: int) -> Found:
    """Return the best of all policies; what time is left goes to random ones like them."""
    rng, heads = np.random.default_rng(seed), len(problem.machine.heads)
    best = Placed(problem, budget)
    while not best.ended:
        best.offer(dispatched(problem, nth_weights(best.orders, heads, rng)))
    return best.found


@dataclass(frozen=True, slots=True)
class Order:
    """A joint order."""

    contour: Ids  # (n,) in the order of their turns
    head: Ids  # (n,) by contour
    reversed: NDArray[np.bool_]  # (n,) by contour

    def toolpaths(self, heads: int) -> list[Toolpath]:
        """Return one toolpath a head."""
        order = self.contour.astype(np.int32)
        return StatedOrder(order, self.reversed[order], self.head[order]).toolpaths(heads)


def order_of(units: Units) -> Order:
    """Return the joint order in which units were placed."""
    stated = stated_of(units)
    n = len(stated.order)
    head, is_reversed = np.empty(n, np.int64), np.empty(n, np.bool_)
    head[stated.order], is_reversed[stated.order] = stated.head, stated.reversed
    return Order(stated.order.astype(np.int64), head, is_reversed)


def window(run: Ids, place: Ids, graph: DependencyGraph) -> tuple[int, int]:
    """Return between which turns, both exclusive, all of a run may be printed."""
    low, high = -1, len(place)
    inside = np.zeros(len(place), np.bool_)
    inside[run] = True
    for c in run:
        before = graph.preds[graph.pred_offsets[c] : graph.pred_offsets[c + 1]]
        after = graph.succs[graph.succ_offsets[c] : graph.succ_offsets[c + 1]]
        low = max(low, int(place[before[~inside[before]]].max(initial=-1)))
        high = min(high, int(place[after[~inside[after]]].min(initial=len(place))))
    return low, high


class RandomMoves:
    """Random changes of a joint order."""

    def __init__(self, problem: TeamProblem, rng: np.random.Generator) -> None:
        self._problem, self._rng = problem, rng

    def changed(self, now: Order) -> Order:
        """Return an order that differs by one run's head, turn or both."""
        rng = self._rng
        run = self._run(now)
        kind = rng.random()
        head = now.head if kind < 0.4 else self._given(run, now.head)
        contour = now.contour if kind > 0.7 else self._moved_in_turn(run, now.contour)
        return Order(contour, head, self._entered(run, now, contour, head))

    def _run(self, now: Order) -> Ids:
        """Return some contours that one head prints one after the other."""
        rng = self._rng
        r = now.head[now.contour[int(rng.integers(len(now.contour)))]]
        mine = now.contour[now.head[now.contour] == r]
        longest = max(1.0, LONGEST * len(mine))
        length = min(len(mine), int(math.exp(rng.uniform(0.0, math.log(longest + 1e-9)))) or 1)
        first = int(rng.integers(len(mine) - length + 1))
        run = mine[first : first + length]
        if rng.random() < 0.5:  # only those of one part
            run = run[self._problem.part[run] == self._problem.part[run[0]]]
        return np.asarray(run)

    def _given(self, run: Ids, head: Ids) -> Ids:
        """Give a run to another head, as far as that one may print it."""
        eligible = self._problem.space.eligible
        others = [r for r in range(eligible.shape[1]) if r != head[run[0]]]
        if not others:
            return head
        r = others[int(self._rng.integers(len(others)))]
        given = head.copy()
        given[run[eligible[run, r]]] = r
        return given

    def _moved_in_turn(self, run: Ids, contour: Ids) -> Ids:
        """Move a run to a turn near its own, within what precedence allows."""
        place = np.empty(len(contour), np.int64)
        place[contour] = np.arange(len(contour))
        low, high = window(run, place, self._problem.graph)
        if high <= low:
            return contour
        moved = np.ones(len(contour), np.bool_)
        moved[place[run]] = False
        away = self._rng.normal(0.0, max(2.0, (high - low) / 4))
        goal = int(np.clip(place[run[0]] + away, low + 1, high))
        at = int(moved[:goal].sum())
        return np.asarray(np.insert(contour[moved], at, run))

    def _entered(self, run: Ids, now: Order, contour: Ids, head: Ids) -> NDArray[np.bool_]:
        """Enter every contour of a run at the end nearer to where its head comes from."""
        visits = self._problem.visits
        is_reversed = now.reversed.copy()
        mine = contour[head[contour] == head[run[0]]]
        at = {int(c): k for k, c in enumerate(mine)}
        for c in run:
            k = at.get(int(c), 0)
            if k and visits.reversible[c]:
                before = mine[k - 1]
                here = visits.ends[before, 0 if is_reversed[before] else 1]
                travels = np.linalg.norm(visits.ends[c] - here, axis=1)
                is_reversed[c] = bool(travels[1] < travels[0])
        return is_reversed


def annealing(problem: TeamProblem, budget: Budget, *, seed: int) -> Found:
    """Anneal until the time is over; returns the best order that was met."""
    rng, heads = np.random.default_rng(seed), len(problem.machine.heads)
    best, moves = Placed(problem, budget), RandomMoves(problem, rng)
    now, value = _first(problem, best, rng)
    while not best.ended:
        tried = moves.changed(now)
        paths = tried.toolpaths(heads)
        units = units_of(problem.visits, problem.fleet, problem.machine, paths)
        makespan = best.offer(units)
        temperature = HOT * (COLD / HOT) ** best.share * best.makespan_s
        if rng.random() < math.exp(min(0.0, (value - makespan) / temperature)):
            now, value = tried, makespan
    return best.found


def _first(problem: TeamProblem, best: Placed, rng: np.random.Generator) -> tuple[Order, float]:
    """Return the best order of the first policies and its makespan, or the one to begin with.

    Where that is far ahead of a few policies no more are tried, as in Dec-MCTS.
    """
    order, value, begun_s, policies_s = None, np.inf, np.inf, np.inf
    if problem.start is not None:
        units = units_of(
            problem.visits, problem.fleet, problem.machine,
            problem.start.stated.toolpaths(len(problem.machine.heads)),
        )  # fmt: skip
        order, value = order_of(units), best.offer(units)
        begun_s = value
    for k in range(FIRST):
        if k >= ENOUGH and begun_s * FAR < policies_s:
            break
        units = dispatched(problem, nth_weights(k, len(problem.machine.heads), rng))
        if order is None or units.end[: int(units.used[0])].max() < value:
            order = order_of(units)
        policies_s = min(policies_s, best.offer(units))
        value = min(value, policies_s)
        if best.ended:
            break
    assert order is not None
    return order, value
