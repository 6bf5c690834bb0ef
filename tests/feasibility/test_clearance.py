"""Whole contours block the head as their segments do, one by one."""

from __future__ import annotations

from itertools import pairwise, permutations, product

import numpy as np
import pytest

from decmcts.feasibility.clearance_kernels import (
    CHUNK,
    Centrelines,
    contact_depth,
    segment_blocks,
)
from decmcts.feasibility.packed_head import boxed, pack_heads
from decmcts.formats.machines.machine_file import load_machine


def beads_of(rng: np.random.Generator, lengths: list[int]) -> Centrelines:
    """Return sloped wanderings on a coarse grid, so that ends touch limits exactly."""
    offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    steps = rng.integers(-6, 7, (offsets[-1], 3)).astype(float)
    steps[offsets[:-1]] = rng.integers(-40, 41, (len(lengths), 3))
    points = np.concatenate([np.cumsum(one, axis=0) for one in np.split(steps, offsets[1:-1])])
    points *= np.array([0.5, 0.5, 0.25])
    return boxed(points, offsets, np.full(len(lengths), 0.75))


@pytest.mark.parametrize("machine", ["paper", "mk4s"])
def test_the_depth_of_contours_is_the_greatest_of_their_segments(machine: str) -> None:
    """An edge missed by a test of boxes would let the head crash into the print."""
    head = pack_heads(load_machine(machine).heads)
    rng, quad, blocking = np.random.default_rng(3), np.empty((4, 2)), 0
    beads = beads_of(rng, [2, 3, CHUNK + 1, CHUNK + 2, 2 * CHUNK + 2])
    z = beads.points[:, 2]
    segments = [range(first, last - 1) for first, last in pairwise(beads.offsets.tolist())]
    for a, b in permutations(range(len(segments)), 2):
        depths = [0.0]
        for q, p, k in product(segments[a], segments[b], range(len(head.heights))):
            if segment_blocks(beads.points, q, p, head, k, 0.75, quad):
                depths.append(z[q : q + 2].max() - z[p : p + 2].min())
        depth, polygon = contact_depth(beads, a, b, head, np.inf, quad)
        assert depth == max(depths)
        assert (polygon >= 0) == (depth > 0.0)
        assert (contact_depth(beads, a, b, head, 0.0, quad)[0] > 0.0) == (depth > 0.0)
        blocking += len(depths) - 1
    assert blocking > 100
