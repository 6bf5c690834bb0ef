"""Windows of a sequence put in their best order, one after the other, exactly.

Annealing leaves any few dozen contours that follow each other in a good order. Their best
order is found in milliseconds (`decmcts.search.hybrid.windows_kernels`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from decmcts.search.bounds.exact import Capacity, slack_of
from decmcts.search.bounds.ideals_kernels import Ideals
from decmcts.search.decomposition.blocks import Sequence, cut
from decmcts.search.decomposition.threads import ROUND_S, Threads
from decmcts.search.hybrid.search import HybridSearch
from decmcts.search.hybrid.windows_kernels import solve_windows
from decmcts.search.sequence.annealing import DESCENT_FROM
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.stopping import next_chunk

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
        sequence.become(threads.join(found))
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
