"""Which policies are near one another."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.team.engine.plans import POLICIES
from decmcts.team.engine.policy import NEAR, beside, places


def test_weights_count_by_their_ratio() -> None:
    """Twice a small weight is as far as twice a large one; nothing is infinitely far."""
    at = places()
    assert at.shape == (len(POLICIES), 6) and np.isfinite(at).all()
    step = np.log10(POLICIES[3, 0] / POLICIES[1, 0]) / 2.5
    assert at[3, 0] - at[1, 0] == pytest.approx(step)


def test_most_moves_are_to_near_policies_some_to_any() -> None:
    """Refines a good policy, but does not stay with it for ever."""
    rng, at = np.random.default_rng(0), places()
    found = np.array([beside(100, rng) for _ in range(500)])
    order = np.argsort(np.linalg.norm(at - at[100], axis=1), kind="stable")
    near = np.isin(found, order[1 : NEAR + 1])
    assert 0.6 < near.mean() < 0.8 and len(set(found.tolist())) > 3 * NEAR
