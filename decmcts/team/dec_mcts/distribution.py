"""The plans a head sends to the others (X̂), how likely it is to follow each (q), and how q moves.

All plans of X̂ are valued beside the same plans of the others, so that a difference in
value is due to the plans themselves. Utilities are scaled to [0, 1] over X̂, so a
temperature means the same on every print.

References
----------
Best et al. 2019, Alg. 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Floats, Int32s
from decmcts.team.dec_mcts.parameters import Parameters

SMALLEST = 1e-6  # probability a candidate keeps
RECENT = 10.0  # samples over which a mean is taken: the others change

Plan = Int32s


@dataclass(frozen=True, slots=True)
class PlanDistribution:
    """What a head sends to the others: (X̂, q) of Dec-MCTS."""

    sequences: tuple[Int32s, ...]  # plans, see decmcts.team.engine.plans
    probabilities: Floats  # (len(sequences),) sums to 1

    @staticmethod
    def uniform(sequences: tuple[Int32s, ...]) -> PlanDistribution:
        """Return the distribution that prefers none."""
        return PlanDistribution(sequences, np.full(len(sequences), 1.0 / len(sequences)))

    @property
    def entropy(self) -> float:
        """How undecided the head is: 0 for one plan, 1 for all alike."""
        q = self.probabilities[self.probabilities > 0.0]
        most = np.log(len(self.probabilities))
        return float(-(q * np.log(q)).sum() / most) if most > 0.0 else 0.0

    def sample(self, rng: np.random.Generator) -> Int32s:
        """Draw a plan."""
        weights = self.probabilities / self.probabilities.sum()
        return self.sequences[int(rng.choice(len(weights), p=weights))]

    def likeliest(self) -> Int32s:
        """Return the plan of largest probability, the first of equals."""
        return self.sequences[int(np.argmax(self.probabilities))]

    def updated(self, expected: Floats, *, beta: float, alpha: float) -> PlanDistribution:
        """Return q after one step towards exp(E[f|x]/β), normalised; `expected[x]` is E[f|x]."""
        steps = step_distribution(self.probabilities, expected, beta, alpha)
        q = np.maximum(self.probabilities + steps, SMALLEST)
        return PlanDistribution(self.sequences, q / q.sum())


def step_distribution(q: Floats, expected: Floats, beta: float, alpha: float) -> Floats:
    """Return the steps -α·q·[(E f - E[f|x]) / β + H(q) + ln q], before normalisation.

    `expected[x]` is E[f|x]; with E f = Σ q·expected the steps sum to zero.
    """
    log = np.log(np.maximum(q, np.finfo(q.dtype).tiny))  # 0·ln 0 is 0
    return -alpha * q * ((q @ expected - expected) / beta - q @ log + log)


class Candidates:
    """X̂ and q, the `distribution`; `sampled` counts how often each plan was valued."""

    def __init__(self, plans: Sequence[Plan], parameters: Parameters) -> None:
        self._parameters = parameters
        self._beta = parameters.beta
        self.distribution = PlanDistribution.uniform(tuple(plans))
        self._mean = np.zeros(len(plans))
        self.sampled = np.zeros(len(plans), np.int64)

    def renew(self, plans: Sequence[Plan]) -> None:
        """Choose another X̂; members that stay keep what is known of them.

        New ones are as likely as one of those before was at first, and the temperature stays.
        """
        before = {plan.tobytes(): k for k, plan in enumerate(self.distribution.sequences)}
        row = np.array([before.get(plan.tobytes(), -1) for plan in plans])
        stays = row >= 0
        q = np.where(stays, self.distribution.probabilities[row], 1.0 / len(before))
        self.distribution = PlanDistribution(tuple(plans), q / q.sum())
        self._mean = np.where(stays, self._mean[row], 0.0)
        self.sampled = np.where(stays, self.sampled[row], 0)

    def update(self, utilities: Floats) -> None:
        """Note what each of X̂ gained beside the same other plans, and move q."""
        self.sampled += 1
        self._mean += (utilities - self._mean) / np.minimum(self.sampled, RECENT)
        low, high = float(self._mean.min()), float(self._mean.max())
        expected = (self._mean - low) / (high - low) if high > low else np.zeros(len(self._mean))
        for _ in range(len(expected)):  # a step for each plan that was valued
            self.distribution = self.distribution.updated(
                expected, beta=self._beta, alpha=self._parameters.alpha
            )
        self._beta = max(self._beta * self._parameters.cooling, self._parameters.coldest)
