"""What the table of printers counts as a contour that could move."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture
def movable(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    from printers import movable

    return movable


def counted(movable, pairs: list[tuple[int, int]], layers: list[int]) -> int:
    return movable(np.array(pairs, np.int32).reshape(-1, 2), np.array(layers, np.int32))


def test_a_chain_through_the_layers_leaves_nothing_free(movable):
    """What follows from two constraints counts as one: 0 before 1 before 2."""
    assert counted(movable, [(0, 1), (1, 2)], [0, 1, 2]) == 0


def test_contours_of_one_layer_are_not_counted_against_each_other(movable):
    """Every order within a layer is layer by layer still."""
    assert counted(movable, [(0, 2), (1, 2)], [0, 0, 1]) == 0


def test_two_towers_are_free_against_each_other(movable):
    """Each contour but for the lowest pair's own layer has one in the other tower."""
    assert counted(movable, [(0, 2), (1, 3)], [0, 0, 1, 1]) == 4


def test_one_free_contour_frees_only_those_of_other_layers(movable):
    """0 and 1 share a layer; 2 lies on 1 alone, so only 0 and 2 may change places."""
    assert counted(movable, [(1, 2)], [0, 0, 1]) == 2
