"""Interval queries over boxes against all pairs."""

from __future__ import annotations

import numpy as np
import pytest

from sim.replay.boxes import near_in_windows


@pytest.mark.parametrize("seed", range(4))
def test_same_pairs_as_brute_force(seed):
    """A pair left out here would never reach FCL."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 40)), int(rng.integers(1, 70))
    boxes, chain = (random_boxes(rng, k) for k in (n, m))
    low = rng.integers(0, m, n)
    high = low + rng.integers(0, m, n)
    due = {
        (i, j)
        for i in range(n)
        for j in range(m)
        if low[i] <= j < high[i]
        and (boxes[i, :3] < chain[j, 3:]).all()
        and (chain[j, :3] < boxes[i, 3:]).all()
    }
    found = all_pairs(boxes, low, high, chain)
    assert {tuple(row) for row in found.tolist()} == due
    assert len(found) == len(due)


def all_pairs(*query):
    return np.concatenate([np.empty((0, 2), np.int64), *near_in_windows(*query)])


def random_boxes(rng, k):
    low = rng.uniform(0, 10, (k, 3))
    return np.hstack([low, low + rng.uniform(0, 4, (k, 3))])


def test_more_pairs_than_first_room_for():
    """Finding more than the first buffer holds must not lose any."""
    box = np.array([[0.0, 0, 0, 1, 1, 1]])
    n = 700  # 490 000 pairs, many blocks
    found = all_pairs(
        np.repeat(box, n, axis=0), np.zeros(n, np.int64), np.full(n, n), np.repeat(box, n, axis=0)
    )
    assert len(found) == n * n
    assert len(np.unique(found, axis=0)) == n * n


def test_empty_chain():
    """A head without actions is near nothing."""
    box = np.array([[0.0, 0, 0, 1, 1, 1]])
    one = np.array([0])
    assert len(all_pairs(box, one, one + 5, np.empty((0, 6)))) == 0
