"""Large neighbourhood search: a few contours at a time are annealed anew.

A neighbourhood is some dozens of contours that lie near each other, in space or along
the sequence. All else is contracted to runs (`decmcts.search.decomposition.contraction`), so
that annealing it, from a temperature drawn at random, takes a fraction of a second and may
move whole runs elsewhere. A result that is no worse is kept. One annealing of a whole
sequence leaves each place about as good as annealing does on average; this keeps the best
of many tries for each place. In turn with that, windows of the sequence are put in their
best order, exactly (`decmcts.search.hybrid.windows`).

References
----------
Shaw 1998, "Using constraint programming and local search methods to solve vehicle
routing problems" (large neighbourhoods, relatedness). Taillard & Helsgaun 2019,
"POPMUSIC for the travelling salesman problem".
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from itertools import repeat

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from decmcts._kernels.random import below, log_uniform
from decmcts._kernels.sequence.anneal import anneal
from decmcts.search.decomposition.blocks import Sequence, cut
from decmcts.search.decomposition.contraction import Contraction, contract
from decmcts.search.decomposition.threads import ROUND_S, Threads
from decmcts.search.hybrid.search import Search
from decmcts.search.hybrid.windows import WindowSolver
from decmcts.search.sequence.annealing import DESCENT_FROM, TemperatureSchedule
from decmcts.search.sequence.incumbent import Incumbent

_SIZE = (15.0, 200.0)  # contours of a neighbourhood
_HOT = (0.3, 5.0)  # between these its first temperature is drawn, in mean travels
_COLD = 0.03  # and its last
_STEPS = (400.0, 1500.0, 50_000.0)  # a contour left: least, most at first, most ever
_MOST_AT_FIRST = 200_000.0  # steps, before it is known how long they take
_LONGEST_S = 0.5  # for one; a thread reads the clock only after each
_PASSES = 20  # neighbourhoods each contour is to be in; the more time, the longer each takes
_SLICES = 12  # of equal temperature
_SCALES = (1.0, 3.0, 10.0)  # of heights: towers to layers
_PART_PASSES = 2  # parts each contour is to be in
_PLACES = (1, 3)  # of the sequence, in a neighbourhood that is no ball


@dataclass(frozen=True, slots=True)
class Places:
    """Where contours lie, for neighbourhoods of several shapes."""

    points: tuple[NDArray[np.float64], ...]  # (n, 3) middles of their ends, one a scale
    trees: tuple[cKDTree, ...]

    @staticmethod
    def of(sequence: Sequence) -> Places:
        """Take the places of the problem's contours."""
        middles = (sequence.problem.start + sequence.problem.end) / 2
        points = tuple(middles * [1.0, 1.0, scale] for scale in _SCALES)
        return Places(points, tuple(map(cKDTree, points)))

    def draw(self, sequence: Sequence, size: int, state: NDArray[np.uint64]) -> NDArray[np.bool_]:
        """Mutate the generator; return which contours are set free, (n,) by contour.

        Either a ball around a random contour, or windows of the sequence around one or three
        contours of such a ball. Bare costs have no places: there the windows are anywhere.
        """
        n, bare = len(sequence.order), sequence.problem.costs is not None
        free = np.ones(n, np.bool_) if bare else self.ball(size, state)
        if not bare and below(state, 2) == 0:
            return free
        ball = np.flatnonzero(free)
        position = np.empty(n, np.int32)
        position[sequence.order] = np.arange(n, dtype=np.int32)
        places = _PLACES[below(state, len(_PLACES))]
        half = max(1, size // (2 * places))
        chosen = [ball[below(state, len(ball))] for _ in range(places)]
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
class Neighbourhoods:
    """Until when the best sequence is improved, and how its time is shared out."""

    until: float = DESCENT_FROM  # share
    windows: float = 0.3  # of the time between two meetings: windows solved exactly
    whole: int = 6000  # contours up to which they are taken of the whole print
    part: int = 1500  # contours set free in a part of a larger one

    def __post_init__(self) -> None:
        if not 0.0 <= self.windows < 1.0:
            raise ValueError(f"windows are {self.windows} of the time, must be 0 or more, below 1")

    def run(self, search: Search) -> Iterator[None]:
        """Improve the best sequence."""
        yield from self.improve(search.incumbent, search.best(), search.threads)

    def improve(self, incumbent: Incumbent, sequence: Sequence, threads: Threads) -> Iterator[None]:
        """Improve a sequence; yield at meetings. The incumbent gets what is better.

        Of a large print all but a part is contracted first, and neighbourhoods are tried
        within that part for a while, since each contraction takes time in proportion to
        all contours left. Mutates the generators.
        """
        n, began = len(sequence.order), incumbent.spent
        solvers = [WindowSolver() for _ in threads.states]
        if n <= self.whole:
            yield from self._improved(incumbent, sequence, threads, solvers, self.until)
            return
        places, turn = Places.of(sequence), (self.until - began) * self.part / (_PART_PASSES * n)
        bare = sequence.problem.costs is not None
        while incumbent.spent < self.until:
            if bare:  # all in one place
                free = places.draw(sequence, self.part, threads.cutting)
            else:
                free = places.ball(self.part, threads.cutting)
            part = _all_but(sequence, free)
            ends = min(self.until, incumbent.spent + turn)
            found = yield from self._improved(incumbent, part.start(), threads, solvers, ends, part)
            sequence = part.expanded(found)
            incumbent.tick()  # a part without travels does not
            yield

    def _improved(
        self,
        incumbent: Incumbent,
        sequence: Sequence,
        threads: Threads,
        solvers: list[WindowSolver],
        until: float,
        contraction: Contraction | None = None,
    ) -> Generator[None, None, Sequence]:
        """Return what neighbourhoods make of a sequence until the share `until`.

        Each thread tries some by itself for a while. Then their results are crossed, and all
        go on from that. It is offered to the incumbent: of a contraction the whole
        sequence it stands for.
        """
        places, began, made = Places.of(sequence), incumbent.spent, 0
        while (spent := incumbent.spent) < until and sequence.cost > 0.0:
            rate = made / (spent - began) if spent > began else 0.0
            count, steps = len(threads.states), rate * (until - began)
            trial = _Trial(incumbent, places, until, rate / count, steps, count, self.windows)
            found = list(threads.pool.map(trial.run, repeat(sequence), threads.states, solvers))
            best = threads.join([result for result, *_ in found])
            if best.cost < sequence.cost:
                whole = best if contraction is None else contraction.expanded(best)
                whole.offer_to(incumbent)
            sequence = best
            annealed, solved = (sum(numbers) for numbers in list(zip(*found, strict=True))[1:])
            made += annealed
            incumbent.tick(annealed + solved)
            yield
        return sequence


@dataclass(frozen=True, slots=True)
class _Trial:
    """How a thread tries neighbourhoods between two meetings of all."""

    incumbent: Incumbent
    places: Places
    until: float  # share
    rate: float  # steps of a thread in the whole search, 0: not known yet
    steps: float  # of all threads until the end, 0: not known yet
    threads: int
    windows: float  # of the time between two meetings

    def run(
        self, sequence: Sequence, state: NDArray[np.uint64], solver: WindowSolver
    ) -> tuple[Sequence, int, int]:
        """Mutate the generator; return what became of it, and steps of annealing and of windows.

        If iterations are limited there is one neighbourhood, so that results repeat.
        """
        n, made, cost, began = len(sequence.order), 0, sequence.cost, self.incumbent.seconds
        longest = min(max(self.steps / (_PASSES * n), _STEPS[1]), _STEPS[2])
        while cost > 0.0:
            free = self.places.draw(sequence, min(n, round(log_uniform(state, *_SIZE))), state)
            hot = log_uniform(state, *_HOT)
            schedule = TemperatureSchedule(cost / n * hot, cost / n * _COLD)
            steps, most = log_uniform(state, _STEPS[0], longest), self._most()
            found, number = _annealed(sequence, free, state, schedule, steps, most)
            made += number
            if (now := found.cost) <= cost:
                sequence, cost = found, now
            if self.incumbent.seconds >= began + ROUND_S * (1 - self.windows) or self._is_over():
                break
        if self.windows == 0.0 or cost == 0.0 or sequence.problem.costs is not None:
            return sequence, made, 0
        sequence = sequence.copy()
        solved = solver.improve(self.incumbent, sequence, state, self._windows_end(made))
        return sequence, made, solved

    def _windows_end(self, made: int) -> float:
        """Return the share at which windows end, after so many steps of annealing."""
        incumbent, limit = self.incumbent, self.incumbent.stopping.iterations
        if limit is not None:
            return incumbent.spent + self.windows / (1.0 - self.windows) * made / limit
        share = incumbent.stopping.share_of(self.windows * ROUND_S)
        return min(self.until, incumbent.spent + share)

    def _most(self) -> float:
        """Return the most steps a neighbourhood may take."""
        stopping, left = self.incumbent.stopping, self.until - self.incumbent.spent
        if stopping.iterations is not None:
            return left * stopping.iterations / self.threads * (1.0 - self.windows)
        return self.rate * min(left, stopping.share_of(_LONGEST_S)) or _MOST_AT_FIRST

    def _is_over(self) -> bool:
        incumbent = self.incumbent
        return incumbent.stopping.iterations is not None or incumbent.spent >= self.until


def _annealed(
    sequence: Sequence,
    free: NDArray[np.bool_],
    state: NDArray[np.uint64],
    schedule: TemperatureSchedule,
    steps: float,
    most: float,
) -> tuple[Sequence, int]:
    """Return the sequence with its free contours annealed, and how many steps that took.

    There are `steps` for each contour of the small problem, but no more than `most`.
    """
    small = _all_but(sequence, free)
    start = small.start()
    block = cut(start, 0, len(start.order))
    slice_ = max(1, int(min(steps * len(start.order), most) / _SLICES))
    for k in range(_SLICES):
        anneal(block.tour, state, schedule.at(k / (_SLICES - 1)), slice_)
    block.put_back(start)
    found = small.expanded(start)
    found.choose_entries()
    return found, slice_ * _SLICES


def _all_but(sequence: Sequence, free: NDArray[np.bool_]) -> Contraction:
    """Return the problem in which all but the free contours is contracted."""
    loose = free[sequence.order]
    return contract(sequence, ~(loose[:-1] | loose[1:]))
