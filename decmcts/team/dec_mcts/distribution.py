"""A head's plan distribution: its candidate plans and how likely it is to follow each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.trees.dmcts import step_distribution

SMALLEST = 1e-6  # probability a candidate keeps


@dataclass(frozen=True, slots=True)
class PlanDistribution:
    """What a head sends to the others: (X̂, q) of Dec-MCTS."""

    sequences: tuple[NDArray[np.int32], ...]  # plans, see decmcts.team.engine.plans
    probabilities: NDArray[np.float64]  # (len(sequences),) sums to 1

    def __post_init__(self) -> None:
        n = len(self.sequences)
        if n == 0 or self.probabilities.shape != (n,):
            raise ValueError(f"{self.probabilities.shape} probabilities for {n} sequences")
        if not abs(float(self.probabilities.sum()) - 1.0) < 1e-3 or self.probabilities.min() < 0:
            raise ValueError(f"probabilities {self.probabilities} do not sum to 1")

    @staticmethod
    def uniform(sequences: tuple[NDArray[np.int32], ...]) -> PlanDistribution:
        """Return the distribution that prefers none."""
        return PlanDistribution(sequences, np.full(len(sequences), 1.0 / len(sequences)))

    @property
    def entropy(self) -> float:
        """How undecided the head is: 0 for one plan, 1 for all alike."""
        q = self.probabilities[self.probabilities > 0.0]
        most = np.log(len(self.probabilities))
        return float(-(q * np.log(q)).sum() / most) if most > 0.0 else 0.0

    def sample(self, rng: np.random.Generator) -> NDArray[np.int32]:
        """Draw a plan."""
        weights = self.probabilities / self.probabilities.sum()
        return self.sequences[int(rng.choice(len(weights), p=weights))]

    def likeliest(self) -> NDArray[np.int32]:
        """Return the plan of largest probability, the first of equals."""
        return self.sequences[int(np.argmax(self.probabilities))]

    def updated(
        self, expected: NDArray[np.float64], *, beta: float, alpha: float
    ) -> PlanDistribution:
        """Return q after one step towards exp(E[f|x]/β), normalised.

        Parameters
        ----------
        expected : (len(sequences),) E[f|x], the mean utility of each plan
        beta : float
            Temperature; small values prefer good plans more.
        alpha : float
            Length of the step.
        """
        steps = step_distribution(self.probabilities, expected, beta, alpha)
        q = np.maximum(self.probabilities + steps, SMALLEST)
        return PlanDistribution(self.sequences, q / q.sum())
