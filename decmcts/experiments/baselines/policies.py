"""List scheduling by policies without plans of heads: the best of all, then random ones like them.

References
----------
Graham 1966, "Bounds for certain multiprocessing anomalies", Bell System Technical
Journal 45(9): list scheduling; the lists here are the planner's own policies.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.team.engine.dispatch_kernels import URGENCY, dispatch
from decmcts.team.engine.joint_kernels import Units
from decmcts.team.engine.order import refuse
from decmcts.team.engine.plans import POLICIES, STEP
from decmcts.team.engine.policy import keys_of, policy_of
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.incumbent import Budget, Found, JointIncumbent

Floats = NDArray[np.float64]
SPREAD = 0.5  # of the logarithm of a random policy's weights, standard deviation


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


def plan(problem: TeamProblem, budget: Budget, *, seed: int) -> Found:
    """Return the best of all policies; what time is left goes to random ones like them."""
    rng, heads = np.random.default_rng(seed), len(problem.machine.heads)
    best = JointIncumbent(budget, heads)
    while not best.ended:
        best.offer(dispatched(problem, nth_weights(best.orders, heads, rng)))
    return best.found
