"""Bare problems from Python: limits and wishes to stop reach the search."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.planning.bare import solve_qcsp, solve_sop
from decmcts.planning.events import Event, Progress
from tests.team.qcsp.problems import problem_of

NOTHING = np.empty((0, 2), np.int32)


def costs_of(n: int) -> np.ndarray:
    """Costs that no search proves optimal at once."""
    points = np.random.default_rng(0).random((n, 2))
    return np.linalg.norm(points[:, None] - points[None, :], axis=2)


@pytest.mark.slow
def test_a_sequence_is_searched_within_its_limits() -> None:
    """As `plan` does: the same words mean the same."""
    told: list[Event] = []
    solve = partial(solve_sop, time_limit_s=600.0, max_iterations=40_000)  # iterations end it
    found = solve(costs_of(40), NOTHING, report=told.append)
    again = solve(costs_of(40), NOTHING)
    assert np.array_equal(found.order, again.order)
    assert found.iterations == again.iterations < 60_000
    assert told and all(isinstance(event, Progress) for event in told)
    stopped = solve_sop(costs_of(40), NOTHING, stop=lambda: True)
    assert stopped.found_by == "start"
    with pytest.raises(InputError, match="must be at least 0"):
        solve_sop(costs_of(3), NOTHING, time_limit_s=-1.0)


@pytest.mark.slow
def test_a_schedule_is_searched_within_its_limits() -> None:
    """As `plan` does: the same words mean the same."""
    problem = problem_of(
        {"t": 1, "s": 1, "p": [4, 3, 5, 2], "l": [2, 2, 6, 5], "r": [0, 0], "l0": [1, 4], "Phi": []}
    )
    whole = solve_qcsp(problem, max_iterations=1000)
    assert whole.proposals <= 1000
    assert solve_qcsp(problem, stop=lambda: True).proposals == 0
    assert solve_qcsp(problem, target=100.0).proposals == 0
    with pytest.raises(InputError, match="must be at least 0"):
        solve_qcsp(problem, max_iterations=-1)
