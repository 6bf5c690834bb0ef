"""Large neighbourhood search: one region of the print at a time is annealed anew.

A region is some hundred contours that lie near each other, in space or along the
sequence. All else is fused to runs (`decmcts.search.fusing`), so that annealing of
the region, from a temperature drawn for it, takes some hundredths of a second and
may carry what lies between elsewhere. What is no worse is kept. Annealing of a
whole sequence ends as good as an average outcome everywhere; this takes the best
of many for each region.

References
----------
Shaw 1998, "Using constraint programming and local search methods to solve vehicle
routing problems" (large neighbourhoods, relatedness). Taillard & Helsgaun 2019,
"POPMUSIC for the travelling salesman problem".
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import repeat

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from decmcts._kernels.anneal import anneal
from decmcts._kernels.random import below, uniform
from decmcts.search.annealing import Cooling
from decmcts.search.fusing import fuse
from decmcts.search.incumbent import Incumbent
from decmcts.search.lanes import Lanes
from decmcts.search.pieces import Sequence, cut

_SIZE = (60.0, 200.0)  # contours of a region
_HOT = (0.3, 5.0)  # between these a region's first temperature is drawn, in mean travels
_COLD = 0.03  # and its last
_STEPS = (400.0, 1500.0, 50_000.0)  # a contour left: least, most at first, most ever
_PASSES = 20  # regions each contour is to be in; the more time, the longer each takes
_SLICES = 12  # of equal temperature
_STRETCHES = (1.0, 3.0, 10.0)  # of heights: towers to layers
_WINDOWS = 3  # stretches of the sequence in a region that is no ball


@dataclass(frozen=True, slots=True)
class Places:
    """Where contours lie, for regions of several shapes."""

    points: tuple[NDArray[np.float64], ...]  # (n, 3) middles of their ends, one a stretch
    trees: tuple[cKDTree, ...]

    @staticmethod
    def of(sequence: Sequence) -> Places:
        """Take the places of the problem's contours."""
        middles = (sequence.problem.start + sequence.problem.end) / 2
        points = tuple(middles * [1.0, 1.0, stretch] for stretch in _STRETCHES)
        return Places(points, tuple(map(cKDTree, points)))

    def draw(self, sequence: Sequence, size: int, state: NDArray[np.uint64]) -> NDArray[np.bool_]:
        """Mutate the generator; return which contours are set free, (n,) by contour.

        Either those next to a random one, or what is printed about it and about some
        that lie near it.
        """
        n, shape = len(sequence.order), below(state, len(self.trees))
        centre = below(state, n)
        _, ball = self.trees[shape].query(self.points[shape][centre], k=np.arange(1, size + 1))
        free = np.zeros(n, np.bool_)
        if below(state, 2) == 0:
            free[ball] = True
            return free
        position = np.empty(n, np.int32)
        position[sequence.order] = np.arange(n, dtype=np.int32)
        half = max(1, size // (2 * _WINDOWS))
        others = [ball[below(state, len(ball))] for _ in range(_WINDOWS - 1)]
        for at in position[[centre, *others]]:
            free[sequence.order[max(at - half, 0) : at + half]] = True
        return free


def anneal_regions(incumbent: Incumbent, sequence: Sequence, lanes: Lanes, until: float) -> bool:
    """Improve a sequence until the share `until` is spent; return whether to stop.

    Each lane tries a region of the same sequence and the better result goes on, to
    the incumbent too. Mutates the generators.
    """
    n, places = len(sequence.order), Places.of(sequence)
    began, made, longest = incumbent.spent, 0, _STEPS[1]
    while (spent := incumbent.spent) < until:
        if spent > began and made:
            all_steps = made * (until - began) / (spent - began)
            longest = min(max(all_steps / (_PASSES * n), _STEPS[1]), _STEPS[2])
        mean = sequence.cost / n
        size = min(n, round(_between(*_SIZE, lanes.cutting)))
        free = [places.draw(sequence, size, lanes.cutting) for _ in lanes.states]
        coolings = [Cooling(mean * _between(*_HOT, lanes.cutting), mean * _COLD) for _ in free]
        steps, most = _between(_STEPS[0], longest, lanes.cutting), math.inf
        if incumbent.budget.iterations is not None:
            most = (until - spent) * incumbent.budget.iterations / len(free)
        tried = (repeat(sequence), free, lanes.states, coolings, repeat(steps), repeat(most))
        found = list(lanes.pool.map(_annealed, *tried))
        best = min((result for result, _ in found), key=lambda result: result.cost)
        if best.cost <= sequence.cost:
            sequence = best
            incumbent.offer(sequence.order, sequence.flip, sequence.seat)
        total = sum(number for _, number in found)
        made += total
        if incumbent.tick(total) or incumbent.cost == 0.0:
            return True
    return False


def _annealed(
    sequence: Sequence,
    free: NDArray[np.bool_],
    state: NDArray[np.uint64],
    cooling: Cooling,
    steps: float,
    most: float,
) -> tuple[Sequence, int]:
    """Return the sequence with its free contours annealed, and how many steps that took.

    There are `steps` for each contour of the fused problem, but no more than `most`.
    """
    loose = free[sequence.order]
    fused = fuse(sequence, ~(loose[:-1] | loose[1:]))
    start = fused.start()
    piece = cut(start, 0, len(start.order))
    slice_ = max(1, int(min(steps * len(start.order), most) / _SLICES))
    for k in range(_SLICES):
        anneal(piece.tour, state, cooling.at(k / (_SLICES - 1)), slice_)
    piece.put_back(start)
    return fused.unfused(start), slice_ * _SLICES


def _between(least: float, most: float, state: NDArray[np.uint64]) -> float:
    """Mutate the generator; return a number between two, log-uniform."""
    return float(least * (most / least) ** uniform(state))
