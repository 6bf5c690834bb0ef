"""Which policies a head tries first: some of all kinds, then those like the best of them.

The heads share the first policies out among them. Then each head tries those rows of
`POLICIES` that are most like one of its own best, so heads look at different places.
"""

from __future__ import annotations

import numpy as np

from decmcts.arrays import Floats
from decmcts.team.engine.dispatch_kernels import BOTTLENECK, OTHERS, URGENCY
from decmcts.team.engine.plans import POLICIES, STEP, TUNED

BEST = 3  # near which the trials go on
NEAR = 16  # policies that count as near one

# Policies as points, (k, 6): like policies make like joint orders. Weights ten times apart are
# 1/2.5 apart, and those below the least are as good as none.
_LOGARITHMIC = (0, 1, STEP, BOTTLENECK, OTHERS)  # columns of POLICIES
_LEAST = np.array([0.1, 0.1, 0.05, 0.01, 0.003])
_LOGS = np.log10(np.maximum(POLICIES[:, _LOGARITHMIC], _LEAST)) / 2.5
POINTS = np.column_stack([_LOGS, POLICIES[:, URGENCY]])


class PolicyTrials:
    """The policies one head tries; `makespans` has those that were tried.

    Parameters
    ----------
    turn, heads : int
        This head is the `turn`-th of so many that share the trials.
    tries : int
        Policies that all heads together try, each head one at least; the first third are
        of all kinds.
    """

    def __init__(self, turn: int, heads: int, *, tries: int) -> None:
        first = _mixed()[: max(1, -(-tries // 3))]
        self._open = list(first[turn % len(first) :: heads])
        self._left = max(1, round(tries / heads))
        self.makespans: dict[int, float] = {}

    def next(self) -> int | None:
        """Return the policy to try now; None when all tries are done."""
        if len(self.makespans) >= self._left:
            return None
        for row in self._open:
            if row not in self.makespans:
                return int(row)
        return self._nearest()

    def stop(self) -> None:
        """Try no more."""
        self._left = len(self.makespans)

    def note(self, row: int, makespan_s: float) -> None:
        """Keep what a policy reached."""
        self.makespans[row] = makespan_s

    def best(self, count: int) -> list[int]:
        """Return the best policies tried, best first."""
        return sorted(self.makespans, key=self.makespans.__getitem__)[:count]

    def _nearest(self) -> int:
        """Return the policy not tried that is nearest to one of the best."""
        distance = np.full(len(POINTS), np.inf)
        for place, row in enumerate(self.best(BEST)):
            distance = np.minimum(distance, _distances(row) * (1.0 + 0.5 * place))
        distance[list(self.makespans)] = np.inf
        return int(np.argmin(distance))


def _mixed() -> list[int]:
    """Return all rows of POLICIES, a tuned one and one of the others in turn at first."""
    tuned, spread = range(TUNED), range(TUNED, len(POLICIES))
    return [row for pair in zip(tuned, spread, strict=False) for row in pair] + [*spread[TUNED:]]


def beside(row: int, rng: np.random.Generator) -> int:
    """Return another policy: one near this one, or now and then any."""
    if rng.random() < 0.3:
        return int(rng.integers(len(POLICIES)))
    near = np.argsort(_distances(row), kind="stable")[1 : NEAR + 1]
    return int(near[rng.integers(len(near))])


def _distances(row: int) -> Floats:
    """Return how far each policy is from one, (k,)."""
    return np.asarray(np.linalg.norm(POINTS - POINTS[row], axis=1))
