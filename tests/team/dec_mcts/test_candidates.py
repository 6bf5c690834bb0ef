"""X̂ and how q moves over it."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.team.dec_mcts.candidates import Candidates
from decmcts.team.dec_mcts.parameters import Parameters

PLANS = tuple(np.array([k], np.int32) for k in range(5))
GAINS = np.array([0.50, 0.52, 0.60, 0.51, 0.30])


def test_q_sharpens_on_the_best_within_few_samples() -> None:
    """Ten samples of each plan is what a large print allows; gains differ by a few percent."""
    mine = Candidates(PLANS, Parameters())
    entropy = [mine.distribution.entropy]
    for _ in range(10):
        mine.update(GAINS)
        entropy.append(mine.distribution.entropy)
    assert entropy[0] == pytest.approx(1.0) and entropy[-1] < 0.5
    assert mine.distribution.likeliest() is PLANS[2]


def test_what_is_alike_stays_alike() -> None:
    """Nothing is preferred for no reason, and nothing is divided by zero."""
    mine = Candidates(PLANS, Parameters())
    mine.update(np.full(5, 0.4))
    assert mine.distribution.probabilities == pytest.approx(np.full(5, 0.2))


def test_the_others_may_change_their_minds() -> None:
    """What was best once must not stay so for ever."""
    mine = Candidates(PLANS, Parameters())
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
