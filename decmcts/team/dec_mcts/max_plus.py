"""Which of the heads' plans to try together: max-plus along the chain of neighbours.

The value of a joint plan is taken to be a sum over pairs of neighbouring heads. The value of
a pair is learnt as the mean over the joint plans that were evaluated. On a chain of heads
max-plus is exact: it is dynamic programming from one end to the other.

References
----------
Kok & Vlassis 2006, "Collaborative multiagent reinforcement learning by payoff
propagation", JMLR 7; Choudhury, Gupta, Morales & Kochenderfer 2021, "Scalable anytime
planning for multi-agent MDPs", AAMAS (factored values within Monte-Carlo tree search).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

OPTIMISM = 1.0  # how much more than expected a pair never seen is worth, in deviations of values
Plan = NDArray[np.int32]


class PairValues:
    """Means of the value over pairs of plans of neighbouring heads, and over single plans.

    Parameters
    ----------
    chain : Sequence[int]
        The heads, each next to its neighbours.
    """

    def __init__(self, chain: Sequence[int]) -> None:
        self._chain = tuple(chain)
        self._sums: dict[tuple[int, bytes, bytes], tuple[int, float]] = {}
        self._all: list[float] = []

    def note(self, plans: Mapping[int, Plan], value: float) -> None:
        """Keep what a joint plan of the chain was worth."""
        self._all.append(value)
        said = [plans[r].tobytes() for r in self._chain]
        keys = [(r, plan, b"") for r, plan in zip(self._chain, said, strict=True)]
        keys += list(zip(self._chain, said, said[1:], strict=False))
        for key in keys:
            count, total = self._sums.get(key, (0, 0.0))
            self._sums[key] = (count + 1, total + value)

    def choose(self, options: Mapping[int, Sequence[Plan]]) -> dict[int, Plan]:
        """Return the combination of one plan of each head with the largest expected value."""
        ahead: list[NDArray[np.int64]] = []
        best = np.zeros(len(options[self._chain[-1]]))
        for r, s in zip(self._chain[-2::-1], self._chain[:0:-1], strict=True):
            total = self._pairs(r, options[r], options[s]) + best
            ahead.append(total.argmax(axis=1))
            best = total.max(axis=1)
        row = int(best.argmax())
        chosen = {self._chain[0]: options[self._chain[0]][row]}
        for s, following in zip(self._chain[1:], reversed(ahead), strict=True):
            row = int(following[row])
            chosen[s] = options[s][row]
        return chosen

    def _pairs(self, head: int, mine: Sequence[Plan], next_: Sequence[Plan]) -> NDArray[np.float64]:
        """Return what each pair is thought to be worth, (len(mine), len(next_))."""
        mean = float(np.mean(self._all)) if self._all else 0.0
        bonus = OPTIMISM * float(np.std(self._all)) if self._all else 0.0
        after = self._chain[self._chain.index(head) + 1]
        single = np.array([self._mean((head, plan.tobytes(), b""), mean) for plan in mine])
        other = np.array([self._mean((after, plan.tobytes(), b""), mean) for plan in next_])
        guess: NDArray[np.float64] = single[:, None] + other[None, :] - mean + bonus
        for i, plan in enumerate(mine):
            for j, beside in enumerate(next_):
                key = (head, plan.tobytes(), beside.tobytes())
                guess[i, j] = self._mean(key, guess[i, j])
        return guess

    def _mean(self, key: tuple[int, bytes, bytes], otherwise: float) -> float:
        count, total = self._sums.get(key, (0, 0.0))
        return total / count if count else float(otherwise)
