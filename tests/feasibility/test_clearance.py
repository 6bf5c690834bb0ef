"""Box tests of the clearance kernels never refuse what the exact test accepts."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.feasibility.clearance_kernels import (
    CHUNK,
    Centrelines,
    fill_boxes,
    segment_blocks,
    segment_reaches,
)
from decmcts.feasibility.packed_head import pack_heads
from decmcts.formats.machines.machine_file import load_machine


def beads_of(rng: np.random.Generator, lengths: list[int]) -> Centrelines:
    """Return sloped wanderings on a coarse grid, so that ends touch limits exactly."""
    offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    steps = rng.integers(-6, 7, (offsets[-1], 3)).astype(float)
    steps[offsets[:-1]] = rng.integers(-40, 41, (len(lengths), 3))
    points = np.concatenate([np.cumsum(one, axis=0) for one in np.split(steps, offsets[1:-1])])
    points *= np.array([0.5, 0.5, 0.25])
    chunks = np.concatenate([[0], np.cumsum(-(-(np.diff(offsets) - 1) // CHUNK))]).astype(np.int64)
    boxes, chunk_boxes = np.empty((len(lengths), 6)), np.empty((chunks[-1], 6))
    fill_boxes(points, offsets, boxes, chunks, chunk_boxes)
    return Centrelines(points, offsets, np.full(len(lengths), 0.75), boxes, chunks, chunk_boxes)


@pytest.mark.parametrize("machine", ["paper", "mk4s"])
def test_a_segment_that_cannot_reach_a_chunk_blocks_nothing_in_it(machine: str) -> None:
    """An edge missed here would let the head crash into the print."""
    head = pack_heads(load_machine(machine).heads)
    rng, quad, refused, blocking = np.random.default_rng(3), np.empty((4, 2)), 0, 0
    beads = beads_of(rng, [2, CHUNK + 1, CHUNK + 2, 2 * CHUNK + 2])
    for q in range(beads.offsets[1] - 1 + 10):
        if q + 1 in beads.offsets:
            continue
        for a in range(len(beads.radius)):
            for p in range(beads.offsets[a], beads.offsets[a + 1] - 1):
                chunk = beads.chunk_offsets[a] + (p - beads.offsets[a]) // CHUNK
                for k in range(len(head.heights)):
                    blocks = segment_blocks(beads.points, q, p, head, k, 0.75, quad)
                    reaches = segment_reaches(
                        beads.points, q, beads.chunk_boxes, chunk, head, k, 0.75
                    )
                    assert reaches or not blocks
                    refused, blocking = refused + (not reaches), blocking + blocks
    assert refused > 100
    assert blocking > 100
