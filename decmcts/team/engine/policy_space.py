"""How alike policies are: each is a point, and like policies make like joint orders."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.engine.dispatch import BOTTLENECK, OTHERS, URGENCY
from decmcts.team.engine.plans import POLICIES, STEP

LEAST = np.array([0.1, 0.1, 0.05, 0.01, 0.003])  # weights below are as good as none
LOGARITHMIC = (0, 1, STEP, BOTTLENECK, OTHERS)  # columns of POLICIES
NEAR = 16  # policies that count as near one


@lru_cache(maxsize=8)
def places(policies: int) -> NDArray[np.float64]:
    """Return the first policies as points, (k, d); weights ten times apart are 1/2.5 apart."""
    rows = POLICIES[:policies]
    logs = np.log10(np.maximum(rows[:, LOGARITHMIC], LEAST)) / 2.5
    return np.column_stack([logs, rows[:, URGENCY]])


def beside(row: int, rng: np.random.Generator, policies: int) -> int:
    """Return another policy: one near this one, or now and then any."""
    if rng.random() < 0.3 or row >= policies:
        return int(rng.integers(policies))
    distance = np.linalg.norm(places(policies) - places(policies)[row], axis=1)
    near = np.argsort(distance, kind="stable")[1 : NEAR + 1]
    return int(near[rng.integers(len(near))]) if len(near) else row
