"""Comparing segments all at once against sorting them by everything."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.formats.gcode.reading import compare


def random_segments(rng, n):
    """Return segments of which several share a place, and the states they were printed in."""
    places = np.round(rng.uniform(0, 50, (n // 2, 6)), 3)[rng.integers(0, n // 2, n)]
    rest = [rng.choice([0.5, 0.6], n), rng.choice([20.0, 30.0], n), rng.integers(0, 2, n)]
    return np.column_stack([places, *rest]), rng.integers(0, 3, n)


def same_by_sorting(a, b, kept_a, kept_b):
    order_a, order_b = compare._order(a, kept_a), compare._order(b, kept_b)
    pairs = (a[order_a], b[order_b], kept_a[order_a], kept_b[order_b])
    return not any(wrong.any() for _, wrong in compare._differing(*pairs))


@pytest.mark.parametrize("column", [None, 0, 5, 6, 7, 8, "state"])
@pytest.mark.parametrize("seed", range(4))
def test_same_at_once_says_what_sorting_says(seed, column) -> None:
    """Shuffled is the same; one number changed in one segment is not."""
    rng = np.random.default_rng(seed)
    a, kept_a = random_segments(rng, 40)
    shuffled = rng.permutation(40)
    b, kept_b = a[shuffled].copy(), kept_a[shuffled].copy()
    if column == "state":
        kept_b[7] += 5
    elif column is not None:
        b[7, column] += 1.0
    same = compare._same_at_once(a, b, kept_a, kept_b)
    assert same == same_by_sorting(a, b, kept_a, kept_b) == (column is None)
