"""List scheduling without plans of heads: policies drawn at random, and who may print what."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.engine.dispatch import URGENCY, dispatch
from decmcts._kernels.engine.joint import Units
from decmcts.team.engine.order import refuse
from decmcts.team.engine.plans import POLICIES, STEP
from decmcts.team.engine.policy import keys_of, policy_of
from decmcts.team.engine.problem import TeamProblem

Floats = NDArray[np.float64]
SPREAD = 0.5  # of the logarithm of a random policy's weights, standard deviation


def dispatched(
    problem: TeamProblem,
    weights: Floats,
    *,
    keys: Floats | None = None,
    eligible: NDArray[np.bool_] | None = None,
) -> Units:
    """Dispatch by these weights; `keys` and `eligible` are the problem's if None."""
    keys = keys_of(problem, weights) if keys is None else keys
    eligible = problem.space.eligible if eligible is None else eligible
    policy = policy_of(problem, weights, keys, eligible)
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
