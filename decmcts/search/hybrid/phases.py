"""The planner `hybrid`: phases, one after the other, until the search is over.

Prints whose layers have few contours are solved exactly, if there is time.
Else what follows depends on size and time: several starts annealed as whole sequences
(`multistart`), or blocks of one sequence shared out among the threads (`partition`); and
then windows put in their best order (`windows`). Last comes a descent. Where a problem has
time lags, annealing takes the place of all that: the other phases do not look at when a
contour is printed, so they would break lags.

References
----------
Gambardella & Dorigo 2000 (moves).

**Windows** are put in their best order, exactly. Annealing leaves any few dozen contours that
follow each other in a good order. Their best order is found in milliseconds
(`decmcts.search.hybrid.windows_kernels`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from decmcts.search.bounds.exact import WIDEST, Capacity, Patience, slack_of, solve_exactly
from decmcts.search.bounds.ideals_kernels import Ideals
from decmcts.search.decomposition.blocks import Sequence, crossover, cut
from decmcts.search.decomposition.threads import (
    ROUND_S,
    Threads,
    anneal_rounds,
    descend_fully,
    open_threads,
)
from decmcts.search.hybrid.multistart import Multistart, Partition
from decmcts.search.hybrid.search import HybridSearch, LayeredStart, SearchPhase, Starts
from decmcts.search.hybrid.windows_kernels import solve_windows
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.stopping import DESCENT_FROM, next_chunk

_CAPACITY = Capacity(100_000, 400_000, 2_000_000, 40_009)  # 25 MiB, if all is used
_WIDEST = 20_000  # steps from all ideals of a level
_CHUNK_S = 0.03  # how often the clock is looked at
_LEAST_CHUNK, _LARGEST_CHUNK = 1_000, 4_000_000  # travels priced


@dataclass(slots=True)
class WindowSolver:
    """How long windows one thread can solve in time, and its memory for that."""

    length: float = 8.0  # positions
    chunk: int = _LEAST_CHUNK  # travels
    _ideals: Ideals = field(default_factory=_CAPACITY.allocate)

    def improve(
        self, incumbent: Incumbent, sequence: Sequence, state: NDArray[np.uint64], until: float
    ) -> int:
        """Mutate the sequence and the generator until the share `until` is spent.

        If iterations are limited, there are as many as that share has. Returns how many.
        """
        if len(sequence.order) <= 2:
            return 0
        block, slack, made = cut(sequence, 0, len(sequence.order)), slack_of(sequence.problem), 0
        limit, spent, most = incumbent.stopping.iterations, incumbent.spent, _CAPACITY.travels
        if limit is not None:
            self.chunk = most = int((until - spent) * limit)
        while spent < until:
            before = incumbent.seconds
            self.length, steps = solve_windows(
                block.tour, self._ideals, state, self.length, slack, _WIDEST, most, self.chunk
            )
            made += steps
            if limit is not None or steps < self.chunk:  # all is in its best order
                break
            took_s = incumbent.seconds - before
            self.chunk = next_chunk(
                steps, took_s, _CHUNK_S, least=_LEAST_CHUNK, most=_LARGEST_CHUNK
            )
            spent = incumbent.spent
        block.put_back(sequence)
        return made


def improve_windows(
    incumbent: Incumbent, sequence: Sequence, threads: Threads, until: float
) -> Iterator[None]:
    """Improve a sequence until the share `until` is spent; yield at meetings.

    Each thread solves windows of its own, and the best of all goes on. Mutates the sequence
    and the generators; the incumbent gets what is better.
    """
    solvers, count = [WindowSolver() for _ in threads.states], len(threads.states)
    while (spent := incumbent.spent) < until:
        ends = spent + (until - spent) / count  # of iterations each thread makes its part
        if incumbent.stopping.iterations is None:
            ends = min(until, spent + incumbent.stopping.share_of(ROUND_S))
        found = [sequence.copy() for _ in solvers]
        made = threads.pool.map(
            WindowSolver.improve, solvers, repeat(incumbent), found, threads.states, repeat(ends)
        )
        total = sum(made)
        sequence.become(crossover(found))
        sequence.choose_entries()
        sequence.offer_to(incumbent)
        incumbent.tick(total)
        yield
        if total == 0:  # too few contours, or iterations
            return


@dataclass(frozen=True, slots=True)
class Windows:
    """Windows of the best sequence."""

    until: float = DESCENT_FROM  # share

    def run(self, search: HybridSearch) -> Iterator[None]:
        """Improve the best sequence."""
        yield from improve_windows(search.incumbent, search.best(), search.threads, self.until)


@dataclass(frozen=True, slots=True)
class Exact:
    """An exact solution, given up soon where it would take too long; times in shares."""

    probe: float = 0.15  # for finding out how long an exact solution would take
    share: float = 0.75  # the longest it may take

    def run(self, search: HybridSearch) -> Iterator[None]:
        """Solve the problem if it can be solved in time; then the search is over."""
        incumbent, widest = search.incumbent, WIDEST
        patience = Patience(lambda: incumbent.spent, self.probe, self.share)
        if incumbent.stopping.iterations is not None:
            widest = min(widest, 1 + int(self.probe * incumbent.stopping.iterations))

        def go_on(made: int, share: float) -> bool:
            incumbent.tick(made)
            return not incumbent.over and patience.lasts(share)

        optimum = solve_exactly(incumbent.problem, go_on, widest=widest)
        if optimum is not None:
            incumbent.offer(optimum.order, optimum.reversed, optimum.entry_id)
            incumbent.prove(optimum.bound)
            incumbent.finish()
        incumbent.tick()
        yield


@dataclass(frozen=True, slots=True)
class Lagged:
    """Annealing that keeps time lags, of a whole sequence on each thread.

    It begins with the source's own order, which keeps them. Temperatures are in mean travels.
    """

    rounds: tuple[float, ...] = (0.1, DESCENT_FROM)  # shares at which rounds end
    hot: float = 0.5
    cold: float = 0.03

    def run(self, search: HybridSearch) -> Iterator[None]:
        """Anneal in rounds."""
        search.incumbent.tick()
        yield
        yield from anneal_rounds(
            search.incumbent, search.near, search.threads, self.rounds, hot=self.hot, cold=self.cold
        )


@dataclass(frozen=True, slots=True)
class Descent:
    """The last of each search: the nearest local optimum, directions and entries that suit it."""

    def run(self, search: HybridSearch) -> Iterator[None]:
        """Take moves that gain, as long as there are any."""
        incumbent = search.incumbent
        incumbent.offer_order(incumbent.order)
        descend_fully(incumbent, search.near)
        incumbent.offer_order(incumbent.order)
        yield


@dataclass(frozen=True, slots=True)
class Hybrid:
    """The phases, each with its parameters, and the number of threads."""

    starts: Starts = field(default_factory=Starts)
    exact: Exact = field(default_factory=Exact)
    layered: LayeredStart = field(default_factory=LayeredStart)
    multistart: Multistart = field(default_factory=Multistart)
    partition: Partition = field(default_factory=Partition)
    windows: Windows = field(default_factory=Windows)
    descent: Descent = field(default_factory=Descent)
    lagged: Lagged = field(default_factory=Lagged)  # where there are time lags
    threads: int = 2  # fixed, so that results do not depend on the machine

    def __post_init__(self) -> None:
        if self.threads < 1:
            raise ValueError("threads: expected 1 or more")

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        """Run the phases until the search is over, at the latest when no travel is left."""
        if len(incumbent.problem) < 2:
            return
        with open_threads(self.threads, seed) as threads:
            for _ in self._steps(HybridSearch(incumbent, threads)):
                if incumbent.over:
                    break

    def _steps(self, search: HybridSearch) -> Iterator[None]:
        """Yield wherever the search may end."""
        for phase in self.phases(search):
            yield from phase.run(search)
            yield

    def phases(self, search: HybridSearch) -> Iterator[SearchPhase]:
        """Yield the phases; each is chosen when it is due."""
        if search.incumbent.problem.timed_lags is not None:
            yield self.lagged
            yield self.descent
            return
        yield self.starts
        yield self.exact
        yield self.layered
        if self.multistart.suits(search):
            yield self.multistart
            yield self.windows
        else:
            yield self.partition
            if self.partition.affords_windows(search):
                yield self.windows
        yield self.descent
