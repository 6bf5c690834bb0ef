"""Static split by side: every contour belongs to the head in whose share of the bed it lies.

The borders stand where all shares are equal work. In half of the time `hybrid` finds one
order of all contours, and each head follows it, leaving out what is not its own. Such
orders can not contradict each other, since all are taken from one order that precedence
allows. In the other half heads choose among their own contours by policies, and borders
are moved.

References
----------
Shen, Pan & Qian 2019, "Research on collaborative 3D printing: partition of the workspace",
Robotics and Computer-Integrated Manufacturing 57.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.print.toolpath import Toolpath
from decmcts.team.baselines.incumbent import Budget, Found, Incumbent
from decmcts.team.baselines.lists import dispatched, nth_weights
from decmcts.team.baselines.one_head import hybrid_order
from decmcts.team.engine.order import units_of
from decmcts.team.engine.problem import TeamProblem

SHIFT = 0.05  # share of all work a border is moved by, standard deviation
BY_ORDER = 0.5  # share of the time for `hybrid`'s order


def owners(problem: TeamProblem, borders: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the one head that prints each contour, (n, heads).

    That is the head of its share, or the nearest to it that may print it.
    """
    eligible = problem.space.eligible
    side = np.searchsorted(borders, problem.quantile)
    away = np.abs(np.arange(eligible.shape[1])[None] - side[:, None]).astype(np.float64)
    owner = np.where(eligible, away, np.inf).argmin(axis=1)
    return np.asarray(np.arange(eligible.shape[1])[None] == owner[:, None])


def split_order(order: Toolpath, owned: NDArray[np.bool_]) -> list[Toolpath]:
    """Return what each head prints, in this order; who waits for whom is left to the engine."""
    paths = []
    for r in range(owned.shape[1]):
        mine = owned[order.order, r]
        paths.append(Toolpath.of(order.order[mine], order.reversed[mine]))
    return paths


def plan(problem: TeamProblem, budget: Budget, *, seed: int) -> Found:
    """Return the best split."""
    rng, heads = np.random.default_rng(seed), len(problem.machine.heads)
    best = Incumbent(budget, heads)
    kept = equal = np.arange(1, heads) / heads
    order = hybrid_order(problem, budget, BY_ORDER, seed)
    paths = split_order(order, owners(problem, equal))
    best.offer(units_of(problem.visits, problem.fleet, problem.machine, paths))
    while not best.ended:
        borders, k = equal, best.orders - 1
        if k % 2:  # every other one moves the best borders
            borders = np.sort(np.clip(kept + rng.normal(0.0, SHIFT, heads - 1), 0.0, 1.0))
        weights, before = nth_weights(k // 2, heads, rng), best.makespan_s
        if best.offer(dispatched(problem, weights, eligible=owners(problem, borders))) < before:
            kept = borders
    return best.found
