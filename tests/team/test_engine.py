"""Whatever heads plan, on whatever machine: it resolves, and the judge accepts the result."""

from __future__ import annotations

import numpy as np
import pytest

from tests.makers.random_teams import KINDS, outcome, problem_of, random_plans


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_hostile_plans_resolve_on_random_machines(seed: int) -> None:
    """Two to eight heads, with and without rails: nothing gets stuck, nothing meets."""
    problem = problem_of(seed)
    rng = np.random.default_rng(seed)
    for kind in (*KINDS, "mixed"):
        found = outcome(problem, random_plans(problem, rng, kind))
        assert not found.fault, kind


@pytest.mark.slow
def test_heads_print_at_once_on_random_machines() -> None:
    """A plan that does not ask for one order is not printed in one, for want of a way out."""
    tried = 0
    for seed in range(12):
        problem = problem_of(seed)
        if problem.space.eligible.any(axis=0).sum() > 1:
            assert outcome(problem, {}).shared_s > 0.0, seed
            tried += 1
    assert tried > 8
