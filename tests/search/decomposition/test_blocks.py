"""A block of a sequence must be a true picture of it: same order constraints, same cost."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decmcts.random_kernels import seeded
from decmcts.search.decomposition.blocks import Sequence, cut
from decmcts.search.sequence.anneal_kernels import anneal
from decmcts.search.sequence.metric_kernels import respects
from decmcts.search.sequence.neighbours import near_ports
from decmcts.search.sequence.problem import OrderProblem
from tests.search.problems import random_problem, tour_cost


def as_sliced(problem: OrderProblem) -> Sequence:
    n = len(problem)
    order, is_reversed = np.arange(n, dtype=np.int32), np.zeros(n, np.uint8)
    entry_id = np.full(n, -1, np.int32)
    return Sequence(problem, problem.ports(), near_ports(problem), order, is_reversed, entry_id)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), density=st.sampled_from([0.0, 0.05, 0.2]))
def test_what_a_block_gains_the_whole_sequence_gains(seed: int, density: float) -> None:
    """Threads work on blocks and trust that nothing outside changes."""
    problem = random_problem(seed, 30, density=density)
    sequence = as_sliced(problem)
    first, last = np.sort(np.random.default_rng(seed).choice(31, 2, replace=False)).tolist()
    before = tour_cost(sequence.metric, sequence.order, sequence.reversed)
    block = cut(sequence, first, last)
    change = anneal(block.tour, seeded(seed), 2.0, 2000)
    block.put_back(sequence)
    after = tour_cost(sequence.metric, sequence.order, sequence.reversed)
    assert after == pytest.approx(before + change, abs=1e-6)
    assert respects(sequence.order, problem.graph.succ_offsets, problem.graph.succs)
    assert not sequence.reversed[~problem.reversible].any()
    outside = np.r_[0:first, last:30]
    assert (sequence.order[outside] == outside).all()
    assert (sequence.reversed[outside] == 0).all()


def test_two_blocks_of_one_sequence_are_joined_without_loss() -> None:
    """Two threads put their halves back one after the other."""
    problem = random_problem(3, 40, density=0.05)
    sequence = as_sliced(problem)
    before = tour_cost(sequence.metric, sequence.order, sequence.reversed)
    halves = [cut(sequence, 0, 17), cut(sequence, 17, 40)]
    gains = [anneal(half.tour, seeded(k), 0.1, 5000) for k, half in enumerate(halves)]
    for half in halves:
        half.put_back(sequence)
    after = tour_cost(sequence.metric, sequence.order, sequence.reversed)
    assert max(gains) < 0.0
    assert respects(sequence.order, problem.graph.succ_offsets, problem.graph.succs)
    # each half kept the other's old contour as its guard, so the hop between them may differ
    hop = np.linalg.norm(problem.ports().max(axis=0) - problem.ports().min(axis=0))
    assert abs(after - (before + sum(gains))) <= 2.0 * hop


def test_near_lists_of_a_block_name_only_what_is_inside() -> None:
    """A port outside would be an index error in the kernels, which do not check."""
    problem = random_problem(8, 30, density=0.05)
    block = cut(as_sliced(problem), 10, 20)
    ports = block.tour.near[block.tour.near >= 0]
    assert len(ports) > 0
    assert ports.max() < 2 * len(block.ids)
    assert block.guards == (1, 1)
    assert block.ids.tolist() == list(range(9, 21))


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), density=st.sampled_from([0.0, 0.05, 0.2]))
def test_a_block_has_the_edges_inside_and_guards_hold_the_ends(seed: int, density: float) -> None:
    """Both sides, against the whole graph edge by edge."""
    problem, rng = random_problem(seed, 20, density=density), np.random.default_rng(seed)
    first, last = np.sort(rng.choice(21, 2, replace=False)).tolist()
    block = cut(as_sliced(problem), first, last)
    tour, ids, k = block.tour, block.ids.tolist(), len(block.ids)
    inner = range(block.guards[0], k - block.guards[1])
    edges = {
        (ids.index(a), ids.index(b)) for a, b in problem.graph.pairs() if a in ids and b in ids
    }
    edges = {(a, b) for a, b in edges if a in inner and b in inner}
    headless = set(inner) - {b for _, b in edges}
    endless = set(inner) - {a for a, _ in edges}
    if block.guards[0]:
        edges |= {(0, b) for b in headless}
    if block.guards[1]:
        edges |= {(a, k - 1) for a in endless}
    preds = np.split(tour.preds, tour.pred_offsets[1:-1])
    succs = np.split(tour.succs, tour.succ_offsets[1:-1])
    assert sorted((a, b) for b in range(k) for a in preds[b]) == sorted(edges)
    assert sorted((a, b) for a in range(k) for b in succs[a]) == sorted(edges)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_near_ports_of_a_block_are_those_inside(seed: int) -> None:
    """Each row has what is there of the whole row, in turn until it is full."""
    problem, rng = random_problem(seed, 20), np.random.default_rng(seed)
    first, last = np.sort(rng.choice(21, 2, replace=False)).tolist()
    sequence = as_sliced(problem)
    block = cut(sequence, first, last)
    ids = block.ids.tolist()
    for row, ports in enumerate(block.tour.near):
        whole = sequence.near[2 * ids[row // 2] + row % 2]
        there = [2 * ids.index(p >> 1) + (p & 1) for p in whole if p >= 0 and p >> 1 in ids]
        full = (there * len(whole))[: len(whole)] or [-1] * len(whole)
        assert ports.tolist() == full
