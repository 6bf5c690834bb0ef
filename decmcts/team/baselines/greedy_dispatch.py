"""Greedy dispatch: whoever is free takes the ready contour of least score, with no plan.

References
----------
Graham 1966, "Bounds for certain multiprocessing anomalies", Bell System Technical
Journal 45(9): list scheduling; the lists here are the planner's own policies.
"""

from __future__ import annotations

import numpy as np

from decmcts.team.baselines.incumbent import Budget, Found, Incumbent
from decmcts.team.baselines.lists import dispatched, nth_weights
from decmcts.team.engine.problem import TeamProblem


def plan(problem: TeamProblem, budget: Budget, *, seed: int) -> Found:
    """Return the best of all policies; what time is left goes to random ones like them."""
    rng, heads = np.random.default_rng(seed), len(problem.machine.heads)
    best = Incumbent(budget, heads)
    while not best.ended:
        best.offer(dispatched(problem, nth_weights(best.orders, heads, rng)))
    return best.found
