"""Whatever heads plan, on whatever machine: it resolves, and the judge accepts the result."""

from __future__ import annotations

import numpy as np
import pytest

from sim.experiments.random_teams import judged, problem_of, random_plans


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_hostile_plans_resolve_on_random_machines(seed: int) -> None:
    """Two to eight heads, with and without a rail: nothing gets stuck, nothing meets."""
    problem = problem_of(seed)
    rng = np.random.default_rng(seed)
    for _ in range(3):
        verdict = judged(problem, random_plans(problem, rng))
        assert verdict.ok, str(verdict.faults[0])
