"""Costs of sequences against slow oracles."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decmcts.search.sequence.entries_kernels import choose_visits
from decmcts.search.sequence.metric_kernels import respects
from tests.search.problems import random_problem, tour_cost


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 9))
def test_directions_are_the_cheapest_of_all(seed: int, n: int) -> None:
    """The dynamic programme claims to be exact."""
    problem = random_problem(seed, n)
    order = np.random.default_rng(seed).permutation(n).astype(np.int32)
    no_entries = np.zeros(n + 1, np.int64)
    is_reversed, _ = choose_visits(problem.ports(), order, problem.reversible, no_entries)
    choices = [(0, 1) if reversible else (0,) for reversible in problem.reversible]
    cheapest = min(
        tour_cost(problem.ports(), order, np.array(directions, np.uint8))
        for directions in itertools.product(*choices)
    )
    assert not is_reversed[~problem.reversible].any()
    assert tour_cost(problem.ports(), order, is_reversed) == pytest.approx(cheapest)


@pytest.mark.parametrize("order", [[0, 1], [0, 1, 1], [0, 1, 3], [1, 0, 2], [0, 1, 2, 0]])
def test_what_is_no_linear_extension_is_seen(order: list[int]) -> None:
    """Every planner's result passes through this gate."""
    offsets, succs = np.array([0, 1, 1, 1]), np.array([1], np.int32)
    assert respects(np.array([0, 2, 1], np.int32), offsets, succs)
    assert not respects(np.array(order, np.int32), offsets, succs)
