"""Large neighbourhood search: one region of the print at a time is annealed anew.

A region is some dozens of contours that lie near each other, in space or along the
sequence. All else is fused to runs (`decmcts.search.hybrid.fusing`), so that annealing of
the region, from a temperature drawn for it, takes a fraction of a second and may
carry what lies between elsewhere. A result that is no worse goes on. Annealing of a
whole sequence ends as good as an average outcome everywhere; this takes the best
of many for each region. In turn with that, short stretches of the sequence are put in
their best order, exactly (`decmcts.search.hybrid.stretches`).

References
----------
Shaw 1998, "Using constraint programming and local search methods to solve vehicle
routing problems" (large neighbourhoods, relatedness). Taillard & Helsgaun 2019,
"POPMUSIC for the travelling salesman problem".
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import repeat

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from decmcts._kernels.random import below, uniform
from decmcts._kernels.sequence.anneal import anneal
from decmcts.search.hybrid.fusing import Fused, fuse
from decmcts.search.hybrid.lanes import ROUND_S, Lanes
from decmcts.search.hybrid.pieces import Sequence, cut
from decmcts.search.hybrid.stretches import Stretches
from decmcts.search.sequence.annealing import Cooling
from decmcts.search.sequence.incumbent import Incumbent

_SIZE = (15.0, 200.0)  # contours of a region
_HOT = (0.3, 5.0)  # between these a region's first temperature is drawn, in mean travels
_COLD = 0.03  # and its last
_STEPS = (400.0, 1500.0, 50_000.0)  # a contour left: least, most at first, most ever
_MOST_AT_FIRST = 200_000.0  # steps, before it is known how long they take
_LONGEST_S = 0.5  # for a region: the clock is looked at between them, the stop wish at meetings
_PASSES = 20  # regions each contour is to be in; the more time, the longer each takes
_SLICES = 12  # of equal temperature
_STRETCHES = (1.0, 3.0, 10.0)  # of heights: towers to layers
_WHOLE = 6000  # contours up to which regions are taken of the whole print
_PART = 1500  # contours set free in a part of a larger one
_PART_PASSES = 2  # parts each contour is to be in
_WINDOWS = (1, 3)  # stretches of the sequence in a region that is no ball


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

        Either a ball, or what is printed before and after one or some contours of it; of
        bare costs, which have no places, before and after any.
        """
        n, bare = len(sequence.order), sequence.problem.costs is not None
        free = np.ones(n, np.bool_) if bare else self.ball(size, state)
        if not bare and below(state, 2) == 0:
            return free
        ball = np.flatnonzero(free)
        position = np.empty(n, np.int32)
        position[sequence.order] = np.arange(n, dtype=np.int32)
        windows = _WINDOWS[below(state, len(_WINDOWS))]
        half = max(1, size // (2 * windows))
        chosen = [ball[below(state, len(ball))] for _ in range(windows)]
        free[:] = False
        for at in position[chosen]:
            free[sequence.order[max(at - half, 0) : at + half]] = True
        return free

    def ball(self, size: int, state: NDArray[np.uint64]) -> NDArray[np.bool_]:
        """Mutate the generator; return which contours lie next to a random one, (n,)."""
        shape = below(state, len(self.trees))
        points = self.points[shape]
        centre = points[below(state, len(points))]
        _, near = self.trees[shape].query(centre, k=np.arange(1, min(size, len(points)) + 1))
        free = np.zeros(len(points), np.bool_)
        free[near] = True
        return free


@dataclass(frozen=True, slots=True)
class Regions:
    """How the time for regions is used."""

    stretched: float = 0.3  # of the time between two meetings: stretches solved exactly

    def run(self, incumbent: Incumbent, sequence: Sequence, lanes: Lanes, until: float) -> bool:
        """Improve a sequence until the share `until` is spent; return whether to stop.

        The incumbent gets what is better. Of a large print a part is fused out first, in
        which regions are tried for a while: fusing takes time with all contours there are.
        Mutates the generators.
        """
        n, began = len(sequence.order), incumbent.spent
        stretches = [Stretches() for _ in lanes.states]
        if n <= _WHOLE:
            return self._improved(incumbent, sequence, lanes, stretches, until)[1]
        places, turn = Places.of(sequence), (until - began) * _PART / (_PART_PASSES * n)
        bare, stop = sequence.problem.costs is not None, False
        while not stop and incumbent.spent < until:
            if bare:  # all in one place
                free = places.draw(sequence, _PART, lanes.cutting)
            else:
                free = places.ball(_PART, lanes.cutting)
            fused = _fused_but(sequence, free)
            turn_ends = min(until, incumbent.spent + turn)
            start = fused.start()
            found, stop = self._improved(incumbent, start, lanes, stretches, turn_ends, fused)
            sequence = fused.unfused(found)
            stop = stop or incumbent.tick()  # a part without travels asks nobody
        return stop

    def _improved(
        self,
        incumbent: Incumbent,
        sequence: Sequence,
        lanes: Lanes,
        stretches: list[Stretches],
        until: float,
        fused: Fused | None = None,
    ) -> tuple[Sequence, bool]:
        """Return what regions make of a sequence until the share `until`, and whether to stop.

        Each lane tries regions by itself for a while; then the best of what both have,
        stretch by stretch, goes on, to the incumbent too: of a fused problem the whole
        sequence it stands for.
        """
        places, began, made = Places.of(sequence), incumbent.spent, 0
        while (spent := incumbent.spent) < until and sequence.cost > 0.0:
            rate = made / (spent - began) if spent > began else 0.0
            count, steps = len(lanes.states), rate * (until - began)
            trial = _Trial(incumbent, places, until, rate / count, steps, count, self.stretched)
            found = list(lanes.pool.map(trial.run, repeat(sequence), lanes.states, stretches))
            best = lanes.join([result for result, *_ in found])
            if best.cost < sequence.cost:
                whole = best if fused is None else fused.unfused(best)
                incumbent.offer(whole.order, whole.flip, whole.seat)
            sequence = best
            annealed, solved = (sum(numbers) for numbers in list(zip(*found, strict=True))[1:])
            made += annealed
            if incumbent.tick(annealed + solved) or incumbent.cost == 0.0:
                return sequence, True
        return sequence, False


@dataclass(frozen=True, slots=True)
class _Trial:
    """How a lane tries regions between two meetings of all."""

    incumbent: Incumbent
    places: Places
    until: float  # share of the budget
    rate: float  # steps of a lane for all of the budget, 0: not known yet
    steps: float  # of all lanes until the end, 0: not known yet
    lanes: int
    stretched: float  # of the time between two meetings

    def run(
        self, sequence: Sequence, state: NDArray[np.uint64], stretches: Stretches
    ) -> tuple[Sequence, int, int]:
        """Mutate the generator; return what regions and stretches made of it, and their steps.

        If iterations are limited there is one region, so that results repeat.
        """
        n, made, cost, began = len(sequence.order), 0, sequence.cost, self.incumbent.seconds
        longest = min(max(self.steps / (_PASSES * n), _STEPS[1]), _STEPS[2])
        while cost > 0.0:
            free = self.places.draw(sequence, min(n, round(_between(*_SIZE, state))), state)
            cooling = Cooling(cost / n * _between(*_HOT, state), cost / n * _COLD)
            steps, most = _between(_STEPS[0], longest, state), self._most()
            found, number = _annealed(sequence, free, state, cooling, steps, most)
            made += number
            if (now := found.cost) <= cost:
                sequence, cost = found, now
            if self.incumbent.seconds >= began + ROUND_S * (1 - self.stretched) or self._is_over():
                break
        if self.stretched == 0.0 or cost == 0.0 or sequence.problem.costs is not None:
            return sequence, made, 0
        sequence = sequence.copy()
        solved = stretches.improve(self.incumbent, sequence, state, self._stretched(made))
        return sequence, made, solved

    def _stretched(self, made: int) -> float:
        """Return the share of the budget at which stretches end, after so many steps."""
        incumbent, limit = self.incumbent, self.incumbent.budget.iterations
        if limit is not None:
            return incumbent.spent + self.stretched / (1.0 - self.stretched) * made / limit
        share = self.stretched * ROUND_S / incumbent.budget.seconds
        return min(self.until, incumbent.spent + share)

    def _most(self) -> float:
        """Return the most steps a region may take."""
        budget, left = self.incumbent.budget, self.until - self.incumbent.spent
        if budget.iterations is not None:
            return left * budget.iterations / self.lanes * (1.0 - self.stretched)
        return self.rate * min(left, _LONGEST_S / budget.seconds) or _MOST_AT_FIRST

    def _is_over(self) -> bool:
        incumbent = self.incumbent
        return incumbent.budget.iterations is not None or incumbent.spent >= self.until


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
    fused = _fused_but(sequence, free)
    start = fused.start()
    piece = cut(start, 0, len(start.order))
    slice_ = max(1, int(min(steps * len(start.order), most) / _SLICES))
    for k in range(_SLICES):
        anneal(piece.tour, state, cooling.at(k / (_SLICES - 1)), slice_)
    piece.put_back(start)
    found = fused.unfused(start)
    found.settle()
    return found, slice_ * _SLICES


def _fused_but(sequence: Sequence, free: NDArray[np.bool_]) -> Fused:
    """Return the problem in which all but the free contours is fused."""
    loose = free[sequence.order]
    return fuse(sequence, ~(loose[:-1] | loose[1:]))


def _between(least: float, most: float, state: NDArray[np.uint64]) -> float:
    """Mutate the generator; return a number between two, log-uniform."""
    return float(least * (most / least) ** uniform(state))
