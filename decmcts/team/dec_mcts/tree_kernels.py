"""The arithmetic of Dec-MCTS on bare arrays: discounted UCT and the distribution step.

Best, Cliff, Patten, Mettu & Fitch 2019, "Dec-MCTS: Decentralized planning for
multi-robot active perception", IJRR 38: D-UCT (Sec. 4.3) and the update of the
plan distribution (Alg. 3).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.compiled import kernel


@kernel
def select_child(
    parent: int,
    first_child: NDArray[np.int32],
    sibling: NDArray[np.int32],
    weight: NDArray[np.float64],
    total: NDArray[np.float64],
    last: NDArray[np.int64],
    clock: NDArray[np.int64],
    gamma: float,
    exploration: float,
) -> int:
    """Child with the largest D-UCT bound, U = F + 2·C·sqrt(ln t_parent / t_child); -1: no child.

    Counts are stored as of `last`, the parent's clock when they were written,
    and discounted only here. Ties go to the child found first.
    """
    now = clock[parent]
    visits = 0.0
    child = first_child[parent]
    while child >= 0:
        visits += weight[child] * gamma ** (now - last[child])
        child = sibling[child]
    best, chosen = -np.inf, -1
    child = first_child[parent]
    while child >= 0:
        own = max(weight[child] * gamma ** (now - last[child]), 1e-12)
        bound = total[child] / weight[child]
        bound += 2.0 * exploration * np.sqrt(max(np.log(max(visits, 1.0)), 0.0) / own)
        if bound > best:
            best, chosen = bound, child
        child = sibling[child]
    return chosen


@kernel
def step_distribution(
    q: NDArray[np.float64], expected: NDArray[np.float64], beta: float, alpha: float
) -> NDArray[np.float64]:
    """Return the steps -α·q·[(E f - E[f|x]) / β + H(q) + ln q], before normalisation.

    `expected[x]` is E[f|x]; with E f = Σ q·expected the steps sum to zero.
    """
    mean = 0.0
    entropy = 0.0
    for x in range(len(q)):
        mean += q[x] * expected[x]
        if q[x] > 0.0:
            entropy -= q[x] * np.log(q[x])
    steps = np.zeros(len(q))
    for x in range(len(q)):
        if q[x] > 0.0:
            gain = (mean - expected[x]) / beta + entropy + np.log(q[x])
            steps[x] = -alpha * q[x] * gain
    return steps
