"""Rows of `decmcts.team.engine.plans.POLICIES`: what dispatch makes of them, and which are alike.

Each policy is a point, and like policies make like joint orders.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from decmcts.team.engine.dispatch_kernels import BOTTLENECK, OTHERS, URGENCY, Policy, write_keys
from decmcts.team.engine.plans import POLICIES, STEP
from decmcts.team.engine.problem import TeamProblem

Floats = NDArray[np.float64]

LEAST = np.array([0.1, 0.1, 0.05, 0.01, 0.003])  # weights below are as good as none
LOGARITHMIC = (0, 1, STEP, BOTTLENECK, OTHERS)  # columns of POLICIES
NEAR = 16  # policies that count as near one


def keys_of(problem: TeamProblem, weights: Floats) -> Floats:
    """Return when each head wants to print each contour, in progress of its part, (heads, n).

    `weights` (heads, 6) are rows of `POLICIES`, or like them.
    """
    everything, terms = np.arange(len(problem.macro)), problem.key_terms()
    keys = np.empty((len(weights), len(everything)))
    for r, row in enumerate(weights):
        write_keys(r, row, everything, terms, keys)
    return keys


def policy_of(
    problem: TeamProblem, weights: Floats, keys: Floats, eligible: NDArray[np.bool_]
) -> Policy:
    """Return the policy of all heads as the kernels take it.

    Parameters
    ----------
    weights : (heads, 6) rows of `POLICIES`, or like them
    keys : (heads, n) least first
    eligible : (n, heads)
    """
    return Policy(
        keys,
        problem.places(),
        eligible,
        np.ascontiguousarray(weights[:, : STEP + 1]),
        problem.column_offsets,
        problem.column,
        problem.graph.succ_offsets,
        problem.graph.succs,
    )


@lru_cache(maxsize=1)
def places() -> Floats:
    """Return all policies as points, (k, d); weights ten times apart are 1/2.5 apart."""
    logs = np.log10(np.maximum(POLICIES[:, LOGARITHMIC], LEAST)) / 2.5
    return np.column_stack([logs, POLICIES[:, URGENCY]])


def beside(row: int, rng: np.random.Generator) -> int:
    """Return another policy: one near this one, or now and then any."""
    if rng.random() < 0.3:
        return int(rng.integers(len(POLICIES)))
    distance = np.linalg.norm(places() - places()[row], axis=1)
    near = np.argsort(distance, kind="stable")[1 : NEAR + 1]
    return int(near[rng.integers(len(near))])
