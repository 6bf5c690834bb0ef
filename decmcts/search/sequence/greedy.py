"""The planner `greedy`: nearest feasible contour, within height buffers or layers.

References
----------
Lensgraf & Mettu 2016, "Beyond layers: A 3D-aware toolpath algorithm for fused
filament fabrication" (greedy, and BufferedGreedy on slabs of limited height).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Floats, Int32s
from decmcts.search.sequence.greedy_kernels import greedy_order
from decmcts.search.sequence.incumbent import Incumbent


@dataclass(frozen=True, slots=True)
class Greedy:
    """Tries the nearest-feasible rule with buffers of several heights."""

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        """Offer one sequence a buffer height, the unlimited one first."""
        heights = np.maximum(incumbent.problem.start[:, 2], incumbent.problem.end[:, 2])
        for buffer, slab in buffers(heights):
            order, is_reversed = nearest_feasible(incumbent, heights, buffer=buffer, slab=slab)
            incumbent.offer(order, is_reversed)
            incumbent.offer_order(order)
            incumbent.tick(1)
            if incumbent.over:
                return


def buffers(heights: Floats) -> Iterator[tuple[float, float]]:
    """Yield (buffer, slab) heights in mm: unlimited, then slabs and sliding windows.

    Sizes are doubled from one layer to the whole print.
    """
    yield np.inf, 0.0
    if len(heights) == 0:
        return
    levels = np.unique(np.round(heights, 6))
    rise = float(levels[-1] - levels[0])
    if rise <= 0.0:
        return
    size = float(np.median(np.diff(levels)))
    while size < rise:
        yield size * (1 - 1e-6), size
        yield size * (1 + 1e-6), 0.0
        size *= 2.0


def nearest_feasible(
    incumbent: Incumbent, key: Floats, *, buffer: float, slab: float = 0.0
) -> tuple[Int32s, NDArray[np.uint8]]:
    """Return order and directions of the nearest-feasible rule, see `greedy_order`."""
    problem, graph = incumbent.problem, incumbent.problem.graph
    return greedy_order(
        incumbent.metric,
        problem.reversible,
        graph.pred_offsets,
        graph.succ_offsets,
        graph.succs,
        key,
        np.argsort(key, kind="stable"),
        buffer,
        slab,
    )


def nearest_in_layers(incumbent: Incumbent) -> tuple[Int32s, NDArray[np.uint8]]:
    """Return order and directions of the nearest-feasible rule, layer after layer."""
    runs = layer_runs(incumbent.problem.layer)
    return nearest_feasible(incumbent, runs.astype(np.float64), buffer=0.0)


def layer_runs(layer: Int32s) -> Int32s:
    """Return the number of each contour's maximal run of equal layers, from 0, (n,)."""
    change = np.diff(layer) != 0
    return np.concatenate([[0], np.cumsum(change)]).astype(np.int32)[: len(layer)]
