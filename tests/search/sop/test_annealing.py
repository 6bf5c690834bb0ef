"""Annealing of bare sequences: what it says it gains it gains, and precedence holds."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.feasibility.graph import DependencyGraph
from decmcts.random_kernels import seeded
from decmcts.search.sequence.stopping import TemperatureSchedule
from decmcts.search.sop.annealing import NearSteps, luby, quenched
from decmcts.search.sop.annealing_kernels import Bare, Shares, anneal_bare
from decmcts.search.sop.precedence import Precedence


def layered(layers: int, contours: int, seed: int) -> tuple[Precedence, np.ndarray]:
    """Return layers of points, each after all of the one before, between a first and a last."""
    rng = np.random.default_rng(seed)
    n = layers * contours + 2
    layer = np.concatenate([[0], 1 + np.arange(n - 2) // contours, [layers + 1]])
    places = rng.uniform(0.0, 100.0, (n, 2))
    costs = np.rint(np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1)))
    precedence = Precedence.of(n, np.argwhere(layer[:, None] + 1 == layer[None]).astype(np.int32))
    return precedence, np.ascontiguousarray(costs[np.ix_(precedence.original, precedence.original)])


def sequence(precedence: Precedence, costs: np.ndarray) -> Bare:
    graph = DependencyGraph.from_pairs(len(costs), precedence.pairs)
    return NearSteps.of(costs, costs, precedence.possible).bare(costs, graph)


def cost(bare: Bare) -> float:
    return float(bare.costs[bare.order[:-1], bare.order[1:]].sum())


KINDS = (Shares(0.0, 0.0), Shares(1.0, 0.0), Shares(0.0, 1.0))


@pytest.mark.parametrize("shares", KINDS)
@pytest.mark.parametrize("contours", [1, 2, 9])
def test_the_change_is_that_of_the_cost_and_precedence_holds(shares: Shares, contours: int) -> None:
    precedence, costs = layered(6, contours, seed=contours)
    bare, state, before = sequence(precedence, costs), seeded(3), 0.0
    for temperature in (1000.0, 10.0, 0.1):
        before = cost(bare)
        change = anneal_bare(bare, shares, state, temperature, 3000, 0, len(costs) - 1)
        assert cost(bare) - before == pytest.approx(change, abs=1e-6)
        assert sorted(bare.order) == list(range(len(costs)))
        np.testing.assert_array_equal(bare.position[bare.order], np.arange(len(costs)))
        pairs = precedence.pairs
        assert (bare.position[pairs[:, 0]] < bare.position[pairs[:, 1]]).all()
    assert bare.order[0] == 0
    assert bare.order[-1] == len(costs) - 1


def test_each_kind_of_proposal_finds_shorter_sequences() -> None:
    for shares in KINDS:
        bare = sequence(*layered(5, 12, seed=1))
        before = cost(bare)
        anneal_bare(bare, shares, seeded(0), 1.0, 20_000, 0, len(bare.order) - 1)
        assert cost(bare) < 0.8 * before


@pytest.mark.parametrize("n", [2, 3, 4])
def test_few_nodes_have_nothing_to_exchange(n: int) -> None:
    pairs = np.array([[0, k] for k in range(1, n)] + [[k, n - 1] for k in range(n - 1)], np.int32)
    precedence = Precedence.of(n, pairs)
    bare = sequence(precedence, np.ones((n, n)))
    assert anneal_bare(bare, Shares(0.5, 0.2), seeded(0), 1.0, 500, 0, n - 1) == 0.0


@pytest.mark.parametrize("shares", KINDS)
@pytest.mark.parametrize(("first", "last"), [(0, 20), (7, 31), (40, 61), (30, 32)])
def test_nothing_outside_the_window_moves(shares: Shares, first: int, last: int) -> None:
    bare = sequence(*layered(5, 12, seed=first))
    before, cost_before = bare.order.copy(), cost(bare)
    change = anneal_bare(bare, shares, seeded(1), 100.0, 5000, first, last)
    assert cost(bare) - cost_before == pytest.approx(change, abs=1e-6)
    np.testing.assert_array_equal(bare.order[: first + 1], before[: first + 1])
    np.testing.assert_array_equal(bare.order[last:], before[last:])
    inner = slice(first + 1, last)
    assert sorted(bare.order[inner]) == sorted(before[inner])
    assert (bare.order[inner] != before[inner]).any() == (last - first > 3)


def test_near_nodes_are_the_cheapest_that_may_follow() -> None:
    precedence, costs = layered(4, 10, seed=2)
    steps = NearSteps.of(costs, costs, precedence.possible)
    assert steps.scale > 0.0
    assert steps.are_distances
    for a, row in enumerate(steps.near):
        possible = np.flatnonzero(precedence.possible[a])
        cheapest = set(possible[np.argsort(costs[a, possible], kind="stable")][:4])
        assert set(row[row >= 0]) <= set(possible)
        assert costs[a, row[row >= 0]].max(initial=0.0) >= costs[a, list(cheapest)].max(initial=0.0)


def test_annealing_ends_cold_and_with_a_quench() -> None:
    schedule = TemperatureSchedule(100.0, 1.0)
    assert quenched(schedule, 0.0) == 100.0
    assert quenched(schedule, 0.46) == pytest.approx(10.0)
    assert quenched(schedule, 0.92) == pytest.approx(1.0)
    assert quenched(schedule, 1.0) == pytest.approx(0.1)


def test_luby() -> None:
    expected = [1, 1, 2, 1, 1, 2, 4, 1, 1, 2, 1, 1, 2, 4, 8]
    assert [luby(k) for k in range(1, 16)] == expected
