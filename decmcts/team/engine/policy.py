"""From rows of `decmcts.team.engine.plans.POLICIES` to what the dispatch kernel takes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.engine.dispatch import Policy, write_keys
from decmcts.team.engine.plans import STEP
from decmcts.team.engine.problem import TeamProblem

Floats = NDArray[np.float64]


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
