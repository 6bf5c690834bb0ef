"""The plan distribution against the formulas of the paper; X̂ and how q moves over it."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.team.dec_mcts.distribution import (
    Candidates,
    PlanDistribution,
    step_distribution,
)
from decmcts.team.dec_mcts.parameters import Parameters

PLANS = tuple(np.array([k], np.int32) for k in range(4))
FIVE = tuple(np.array([k], np.int32) for k in range(5))
GAINS = np.array([0.50, 0.52, 0.60, 0.51, 0.30])


@pytest.mark.parametrize("seed", range(5))
def test_steps_sum_to_zero(seed: int) -> None:
    """With exact expectations q stays a distribution without normalising."""
    rng = np.random.default_rng(seed)
    q = rng.dirichlet(np.ones(6))
    steps = step_distribution(q, rng.random(6), 0.3, 0.01)
    assert steps.sum() == pytest.approx(0.0, abs=1e-15)
    assert np.abs(steps).max() > 1e-6


def test_fixed_point_is_the_boltzmann_distribution() -> None:
    """Where E[f|x] is known, q goes to exp(E[f|x] / β) and stays there."""
    expected = np.array([0.2, 0.5, 0.9, 0.1])
    wanted = np.exp(expected / 0.5)
    wanted /= wanted.sum()
    steps = step_distribution(wanted, expected, 0.5, 0.01)
    assert np.abs(steps).max() < 1e-15
    told = PlanDistribution.uniform(PLANS)
    for _ in range(5000):
        told = told.updated(expected, beta=0.5, alpha=0.01)
    assert told.probabilities == pytest.approx(wanted, abs=1e-6)


def test_a_certain_plan_has_no_step_of_infinity() -> None:
    """q(x) = 0 has ln q = -∞ but the step is 0·∞ = 0 there."""
    steps = step_distribution(np.array([1.0, 0.0]), np.array([0.1, 0.9]), 1.0, 0.1)
    assert np.isfinite(steps).all()


def test_sampling_follows_the_probabilities() -> None:
    """x⁻ʳ is drawn from q⁻ʳ, not from the likeliest alone."""
    told = PlanDistribution(PLANS, np.array([0.7, 0.2, 0.1, 0.0]))
    rng = np.random.default_rng(0)
    counts = np.bincount([int(told.sample(rng)[0]) for _ in range(2000)], minlength=4)
    assert counts / 2000 == pytest.approx(told.probabilities, abs=0.04)
    assert told.likeliest() is PLANS[0]


def test_q_sharpens_on_the_best_within_few_samples() -> None:
    """Ten samples of each plan is what a large print allows; gains differ by a few percent."""
    mine = Candidates(FIVE, Parameters())
    entropy = [mine.distribution.entropy]
    for _ in range(10):
        mine.update(GAINS)
        entropy.append(mine.distribution.entropy)
    assert entropy[0] == pytest.approx(1.0) and entropy[-1] < 0.5
    assert mine.distribution.likeliest() is FIVE[2]


def test_what_is_alike_stays_alike() -> None:
    """Nothing is preferred for no reason, and nothing is divided by zero."""
    mine = Candidates(FIVE, Parameters())
    mine.update(np.full(5, 0.4))
    assert mine.distribution.probabilities == pytest.approx(np.full(5, 0.2))


def test_the_others_may_change_their_minds() -> None:
    """What was best once must not stay so for ever."""
    mine = Candidates(FIVE, Parameters())
    for _ in range(20):
        mine.update(GAINS)
    for _ in range(60):
        mine.update(np.array([0.9, 0.1, 0.1, 0.1, 0.1]))
    assert mine.distribution.likeliest() is FIVE[0]


def test_members_that_stay_keep_what_is_known_of_them() -> None:
    """Choosing X̂ anew must not make a head undecided again."""
    mine = Candidates(FIVE, Parameters())
    for _ in range(8):
        mine.update(GAINS)
    new = np.array([9], np.int32)
    mine.renew((FIVE[2], FIVE[0], new))
    assert mine.sampled.tolist() == [8, 8, 0]
    assert mine.distribution.likeliest() is FIVE[2] and mine.distribution.entropy < 0.9
    assert mine.distribution.probabilities.sum() == pytest.approx(1.0)
