"""Annealing on several threads at once: each a whole sequence, or blocks of one.

Whole sequences are each offered to the incumbent. Blocks are parts of one sequence, so
every step of every thread improves the same one, but nothing moves across a cut between
blocks. No move is ruled out for long: cuts are placed anew all the time, and in every other
turn each thread has the whole sequence in place of blocks, and their results are crossed
(`decmcts.search.decomposition.blocks.crossover`).

Each thread has a generator of its own, and results are put together in a fixed order. So
equal seeds and equal iterations give equal sequences, whichever thread is faster.

References
----------
Taillard & Helsgaun 2019, "POPMUSIC for the travelling salesman problem" (parts
of a solution improved one by one).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Int32s
from decmcts.random_kernels import seeded, uniform
from decmcts.search.decomposition.blocks import Sequence, SequenceBlock, crossover, cut
from decmcts.search.sequence.anneal_kernels import anneal, descend
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.stopping import Stopping, TemperatureSchedule, next_chunk

ROUND_S = 0.4  # how long threads work before they meet, where the slowest keeps all waiting
_CHUNK_S = 0.02  # how often a thread looks at the clock
_LEAST_CHUNK, _LARGEST_CHUNK = 1000, 4_000_000  # proposals
_ROUNDS = 400  # of a search that is limited by iterations
_CUT_A_ROUND = 1_000_000  # a cut lasts a round for so many contours and edges: cutting takes time
_LEAST_BLOCK = 100  # contours
_STEPS_A_S = 1.5e6  # of a thread, about
_POSITIONS = 500  # positions between looks at the clock in a descent
_LONGEST_SWAP = 50  # segments tried exhaustively; longer ones are left to annealing

Chunks: TypeAlias = Iterator[tuple[float, int]]


@dataclass(frozen=True, slots=True)
class Threads:
    """The threads, a generator for each, and one more that places the cuts."""

    pool: ThreadPoolExecutor
    states: list[NDArray[np.uint64]]  # (1,) each, mutated
    cutting: NDArray[np.uint64]  # (1,) mutated

    def steps(self, stopping: Stopping) -> float:
        """Return about how many steps each thread has time for in the whole search."""
        if stopping.iterations is not None:
            return stopping.iterations / len(self.states)
        assert stopping.seconds is not None
        return stopping.seconds * _STEPS_A_S


@contextmanager
def open_threads(count: int, seed: int) -> Iterator[Threads]:
    """Yield `count` threads with unrelated generators."""
    states = [seeded(seed * (count + 1) + thread) for thread in range(count + 1)]
    with ThreadPoolExecutor(count) as pool:
        yield Threads(pool, states[:count], states[count])


def anneal_sequences(
    incumbent: Incumbent,
    sequences: list[Sequence],
    threads: Threads,
    schedules: list[TemperatureSchedule],
    until: float,
    *,
    groups: list[Int32s] | None = None,
) -> Iterator[None]:
    """Anneal one whole sequence a thread until the share `until` is spent; yield at meetings.

    Each has a temperature schedule of its own, and moves stay within equal `groups`, (n,) by
    contour and non-decreasing along the sequence. Mutates the sequences and the generators.
    Each is offered to the incumbent.
    """
    tours: list[SequenceBlock] = []

    def begin() -> None:
        tours[:] = [cut(sequence, 0, len(sequence.order)) for sequence in sequences]
        if groups is not None:
            tours[:] = [tour.within(group) for tour, group in zip(tours, groups, strict=True)]

    def work(thread: int, chunks: Chunks) -> None:
        state, schedule = threads.states[thread], schedules[thread]
        for share, proposals in chunks:
            anneal(tours[thread].tour, state, schedule.at(share), proposals)

    def meet() -> None:
        for sequence, tour in zip(sequences, tours, strict=True):
            tour.put_back(sequence)
            sequence.choose_entries()
            sequence.offer_to(incumbent)

    yield from _in_rounds(incumbent, threads, until, begin, work, meet)


def anneal_rounds(
    incumbent: Incumbent,
    near: Int32s,
    threads: Threads,
    ends: tuple[float, ...],
    *,
    hot: float,
    cold: float,
    group: Int32s | None = None,
) -> Iterator[None]:
    """Anneal whole sequences in rounds, each from the best so far; yield at meetings.

    A round ends at one of the shares `ends`. Temperatures are in mean travels of the best
    sequence, and moves stay within equal `group`, (n,). Mutates the generators.
    """
    for until in ends:
        mean, count = incumbent.cost / len(incumbent.problem), len(threads.states)
        sequences = [Sequence.best_of(incumbent, near) for _ in range(count)]
        schedules = [TemperatureSchedule(hot * mean, cold * mean)] * count
        groups = None if group is None else [group] * count
        yield from anneal_sequences(incumbent, sequences, threads, schedules, until, groups=groups)


def descend_fully(incumbent: Incumbent, near: Int32s, group: Int32s | None = None) -> None:
    """Improve the best sequence until no nearby move does or the search is over.

    Moves stay within equal `group`, (n,). Each position looked at counts as an iteration.
    """
    sequence, n, gain = Sequence.best_of(incumbent, near), len(incumbent.problem), -1.0
    block = cut(sequence, 0, n)
    block = block if group is None else block.within(group)
    while gain < 0.0:
        gain = 0.0
        for first in range(0, n, _POSITIONS):
            gain += descend(block.tour, first, min(first + _POSITIONS, n), _LONGEST_SWAP)
            block.put_back(sequence)
            sequence.offer_to(incumbent)
            incumbent.tick(min(_POSITIONS, n - first))
            if incumbent.over:
                return


def anneal_blocks(
    incumbent: Incumbent,
    sequence: Sequence,
    threads: Threads,
    schedule: TemperatureSchedule,
    until: float,
    *,
    blocks: int,
) -> Iterator[None]:
    """Anneal one sequence on all threads until the share `until` is spent; yield at meetings.

    There are so many `blocks` for each thread, fewer where they would be too small; in
    every other turn, and always if that is 0, each thread has the whole sequence, and
    their results are crossed. Mutates the sequence and the generators; the sequence is
    offered to the incumbent at each meeting.
    """
    n, count = len(sequence.order), len(threads.states)
    shares: list[list[SequenceBlock]] = []
    whole, begun, lasting = False, 0, 1 + (n + len(sequence.problem.graph.preds)) // _CUT_A_ROUND

    def begin() -> None:
        nonlocal shares, whole, begun
        if begun % lasting == 0:
            too_few = blocks == 0 or n < _LEAST_BLOCK * count
            whole = too_few or begun // lasting % 2 == 1
            shares = _whole(sequence, count) if whole else _parted(sequence, threads, blocks)
        begun += 1

    def work(thread: int, chunks: Chunks) -> None:
        contours = sum(len(block.ids) for block in shares[thread])
        for share, proposals in chunks:
            temperature = schedule.at(share)
            for block in shares[thread]:
                steps = max(1, proposals * len(block.ids) // contours)
                anneal(block.tour, threads.states[thread], temperature, steps)

    def meet() -> None:
        found = [sequence.copy() if whole else sequence for _ in shares]
        for own, mine in zip(found, shares, strict=True):
            for block in mine:
                block.put_back(own)
        if whole:
            sequence.become(crossover(found))
        if begun % lasting == 0:  # else the same blocks go on, with entries of their own
            sequence.choose_entries()
        sequence.offer_to(incumbent)

    yield from _in_rounds(incumbent, threads, until, begin, work, meet)


def _in_rounds(
    incumbent: Incumbent,
    threads: Threads,
    until: float,
    begin: Callable[[], None],
    work: Callable[[int, Chunks], None],
    meet: Callable[[], None],
) -> Iterator[None]:
    """Let threads work until the share `until` is spent; yield whenever they have met.

    They meet after each round only: on a machine that is shared a thread is held up now
    and then, and others shall not wait for it more often than needed.
    """
    began, limit, count = incumbent.spent, incumbent.stopping.iterations, len(threads.states)
    first = 2000 if limit is None else int(min(max(limit / _ROUNDS, 1.0), _LARGEST_CHUNK))
    sizes = [first] * count
    while incumbent.spent < until:
        begin()
        ends = min(until, incumbent.spent + incumbent.stopping.share_of(ROUND_S))
        rounds = [_Round(incumbent, began, until, ends, size) for size in sizes]
        list(threads.pool.map(work, range(count), map(_Round.chunks, rounds)))
        meet()
        sizes = [round_.size for round_ in rounds]
        incumbent.tick(sum(round_.made for round_ in rounds))
        yield


@dataclass(slots=True)
class _Round:
    """A thread's proposals between two meetings: until a time, or one chunk of a set size."""

    incumbent: Incumbent
    began: float  # share spent at the first round
    until: float  # and after the last
    ends: float  # and after this one
    size: int  # proposals of the next chunk
    made: int = 0

    def chunks(self) -> Chunks:
        """Yield the share done of all rounds and how many proposals to make, chunk by chunk."""
        incumbent, length = self.incumbent, self.until - self.began
        if incumbent.stopping.iterations is not None:
            self.made = self.size
            yield (incumbent.spent - self.began) / length, self.size
            return
        while (spent := incumbent.spent) < self.ends:
            before = incumbent.seconds
            yield (spent - self.began) / length, self.size
            self.made += self.size
            took_s = incumbent.seconds - before
            self.size = next_chunk(
                self.size, took_s, _CHUNK_S, least=_LEAST_CHUNK, most=_LARGEST_CHUNK
            )


def _whole(sequence: Sequence, count: int) -> list[list[SequenceBlock]]:
    """Return the whole sequence for each thread."""
    block = cut(sequence, 0, len(sequence.order))
    return [[block], *([block.twin()] for _ in range(count - 1))]


def _parted(sequence: Sequence, threads: Threads, most: int) -> list[list[SequenceBlock]]:
    """Return the blocks of each thread, about as many contours for each.

    There are `most` for each thread and one more in all, fewer where they would be too small.
    Those at the two ends may be short.
    """
    n, count = len(sequence.order), len(threads.states)
    parts = min(n // (_LEAST_BLOCK * count), most) * count  # at least `count`
    shift = uniform(threads.cutting)
    places = [0, *(int((shift + k) * n / parts) for k in range(parts)), n]
    blocks = [cut(sequence, a, b) for a, b in pairwise(places) if a < b]
    shares: list[list[SequenceBlock]] = [[] for _ in range(count)]
    for block in sorted(blocks, key=lambda block: (-len(block.ids), block.first)):
        min(shares, key=lambda share: sum(len(p.ids) for p in share)).append(block)
    return shares
