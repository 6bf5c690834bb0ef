"""X̂ and how q moves over it, by the gradient and by regrets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.team.dec_mcts.candidates import Candidates
from decmcts.team.dec_mcts.parameters import Parameters

PLANS = tuple(np.array([k], np.int32) for k in range(5))
GAINS = np.array([0.50, 0.52, 0.60, 0.51, 0.30])
RULES = ("gradient", "regret-matching")


@pytest.mark.parametrize("rule", RULES)
def test_q_sharpens_on_the_best_within_few_samples(rule: str) -> None:
    """Ten samples of each plan is what a large print allows; gains differ by a few percent."""
    mine = Candidates(PLANS, replace(Parameters(), distribution=rule))
    entropy = [mine.distribution.entropy]
    for _ in range(10):
        mine.update(GAINS)
        entropy.append(mine.distribution.entropy)
    assert entropy[0] == pytest.approx(1.0) and entropy[-1] < 0.5
    assert mine.distribution.likeliest() is PLANS[2]


@pytest.mark.parametrize("rule", RULES)
def test_what_is_alike_stays_alike(rule: str) -> None:
    """Nothing is preferred for no reason, and nothing is divided by zero."""
    mine = Candidates(PLANS, replace(Parameters(), distribution=rule))
    mine.update(np.full(5, 0.4))
    assert mine.distribution.probabilities == pytest.approx(np.full(5, 0.2))


@pytest.mark.parametrize("rule", RULES)
def test_the_others_may_change_their_minds(rule: str) -> None:
    """What was best once must not stay so for ever."""
    mine = Candidates(PLANS, replace(Parameters(), distribution=rule))
    for _ in range(20):
        mine.update(GAINS)
    for _ in range(60):
        mine.update(np.array([0.9, 0.1, 0.1, 0.1, 0.1]))
    assert mine.distribution.likeliest() is PLANS[0]


def test_members_that_stay_keep_what_is_known_of_them() -> None:
    """Choosing X̂ anew must not make a head undecided again."""
    mine = Candidates(PLANS, Parameters())
    for _ in range(8):
        mine.update(GAINS)
    new = np.array([9], np.int32)
    mine.renew((PLANS[2], PLANS[0], new))
    assert mine.sampled.tolist() == [8, 8, 0]
    assert mine.distribution.likeliest() is PLANS[2] and mine.distribution.entropy < 0.9
    assert mine.distribution.probabilities.sum() == pytest.approx(1.0)


def test_regrets_are_those_of_the_formula() -> None:
    """R(x) is the sum of f(x) - E f, fading, and q its positive part (Hart & Mas-Colell 2000)."""
    rule = replace(Parameters(), distribution="regret-matching", gamma=0.8)
    mine = Candidates(PLANS[:3], rule)
    regret, q = np.zeros(3), np.full(3, 1 / 3)
    for gains in ([0.0, 1.0, 0.5], [1.0, 0.0, 0.2], [0.3, 0.0, 1.0]):
        mine.update(np.array(gains))
        regret = 0.8 * regret + np.array(gains) - q @ np.array(gains)
        q = np.maximum(regret, 0.0) / np.maximum(regret, 0.0).sum()
        assert mine.distribution.probabilities == pytest.approx(q)
