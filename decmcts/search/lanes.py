"""Annealing on several threads at once: rivals on whole sequences, or pieces of one.

Rivals anneal a sequence each and the better one is taken. Pieces share one
sequence out: as many steps are made together as threads allow, but nothing moves
across a cut. Cuts are placed anew all the time, and in every other turn rivals
take the place of pieces, so that no move is ruled out for long. Each thread has a
generator of its own and results are joined in a fixed order: equal seeds and
equal iterations give equal sequences, whatever the threads' pace.

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

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.anneal import anneal
from decmcts._kernels.random import seeded, uniform
from decmcts.search.annealing import Cooling
from decmcts.search.fusing import Fused
from decmcts.search.incumbent import Incumbent
from decmcts.search.pieces import Piece, Sequence, cut

_POLL_S = 0.05  # how often a search looks at the clock and the stop wish
_LARGEST_SLICE = 4_000_000
_SLICES = 400  # of a search that is limited by iterations
_CONTOURS_A_SLICE = 800  # a cut lasts a slice for so many: cutting takes a twentieth of the time
_LEAST_PIECE = 100  # contours


@dataclass(frozen=True, slots=True)
class Lanes:
    """The threads, a generator for each, and one more that places the cuts."""

    pool: ThreadPoolExecutor
    states: list[NDArray[np.uint64]]  # (1,) each, mutated
    cutting: NDArray[np.uint64]  # (1,) mutated

    def fresh(self, count: int) -> list[NDArray[np.uint64]]:
        """Mutate `cutting`; return `count` new generators."""
        return [seeded(int(uniform(self.cutting) * 2**53)) for _ in range(count)]


@contextmanager
def open_lanes(count: int, seed: int) -> Iterator[Lanes]:
    """Yield `count` threads with unrelated generators."""
    states = [seeded(seed * (count + 1) + lane) for lane in range(count + 1)]
    with ThreadPoolExecutor(count) as pool:
        yield Lanes(pool, states[:count], states[count])


def anneal_rivals(
    incumbent: Incumbent,
    rivals: list[Sequence],
    lanes: Lanes,
    coolings: list[Cooling],
    until: float,
    *,
    fused: Fused | None = None,
) -> bool:
    """Anneal one whole sequence a lane until the share `until` is spent; return whether to stop.

    Each has a cooling of its own. Mutates the sequences and the generators; the
    incumbent gets what is best, of fused sequences the whole one they stand for.
    """
    tours = [cut(rival, 0, len(rival.order)) for rival in rivals]

    def slice_of(share: float, proposals: int) -> int:
        def work(lane: int) -> None:
            heat = coolings[lane].at(share)
            anneal(tours[lane].tour, lanes.states[lane], heat, proposals)

        list(lanes.pool.map(work, range(len(rivals))))
        for rival, tour in zip(rivals, tours, strict=True):
            tour.put_back(rival)
            found = rival if fused is None else fused.unfused(rival)
            incumbent.offer(found.order, found.flip, found.seat)
        return proposals * len(rivals)

    return _in_slices(incumbent, slice_of, until)


def anneal_pieces(
    incumbent: Incumbent,
    sequence: Sequence,
    lanes: Lanes,
    cooling: Cooling,
    until: float,
    *,
    a_lane: int,
) -> bool:
    """Anneal one sequence on all lanes until the share `until` is spent; return whether to stop.

    There are `a_lane` pieces for each lane, fewer where they would be too small; in
    every other turn each lane has the whole sequence, and the best goes on.
    Mutates the sequence and the generators; offers what it passes to the incumbent.
    """
    n, count = len(sequence.order), len(lanes.states)
    shares: list[list[Piece]] = []
    done, lasting = 0, max(1, n // _CONTOURS_A_SLICE)

    def slice_of(share: float, proposals: int) -> int:
        nonlocal shares, done
        rivals = done // lasting % 2 == 1
        if done % lasting == 0 and rivals:
            shares = [[cut(sequence, 0, n)] for _ in range(count)]
        elif done % lasting == 0:
            shares = _shared_out(sequence, lanes, a_lane)
        done += 1
        heat = cooling.at(share)
        rate = proposals / n if rivals else proposals * count / n

        def work(lane: int) -> int:
            steps = [max(1, int(rate * len(piece.ids))) for piece in shares[lane]]
            for piece, step in zip(shares[lane], steps, strict=True):
                anneal(piece.tour, lanes.states[lane], heat, step)
            return sum(steps)

        steps = sum(lanes.pool.map(work, range(len(shares))))
        pieces = [piece for pieces in shares for piece in pieces]
        for piece in [min(pieces, key=_travel)] if rivals else pieces:
            piece.put_back(sequence)
        incumbent.offer(sequence.order, sequence.flip, sequence.seat)
        return steps

    return _in_slices(incumbent, slice_of, until)


def _travel(piece: Piece) -> float:
    return float(piece.tour.after.sum())


def _in_slices(incumbent: Incumbent, work: Callable[[float, int], int], until: float) -> bool:
    """Call `work(share done, proposals a lane)` until the budget's share `until` is spent.

    `work` returns how many proposals there were. Returns whether to stop.
    """
    began, proposals = incumbent.spent, 2000
    if incumbent.budget.iterations is not None:
        proposals = int(min(max(incumbent.budget.iterations / _SLICES, 1.0), _LARGEST_SLICE))
    while (spent := incumbent.spent) < until:
        before = incumbent.seconds
        made = work((spent - began) / (until - began), proposals)
        if incumbent.tick(made) or incumbent.cost == 0.0:
            return True
        if incumbent.budget.iterations is None:
            speed = proposals / max(incumbent.seconds - before, 1e-6)
            proposals = int(min(max(_POLL_S * speed, 1000.0), 4.0 * proposals, _LARGEST_SLICE))
    return False


def _shared_out(sequence: Sequence, lanes: Lanes, a_lane: int) -> list[list[Piece]]:
    """Return the pieces of each lane, about as many contours for each."""
    n, count = len(sequence.order), len(lanes.states)
    parts = min(n // (_LEAST_PIECE * count), a_lane) * count
    shift = uniform(lanes.cutting)
    places = [0, *(int((shift + k) * n / parts) for k in range(parts)), n] if parts else [0, n]
    pieces = [cut(sequence, a, b) for a, b in pairwise(places) if a < b]
    shares: list[list[Piece]] = [[] for _ in range(count)]
    for piece in sorted(pieces, key=lambda piece: (-len(piece.ids), piece.first)):
        min(shares, key=lambda share: sum(len(p.ids) for p in share)).append(piece)
    return shares
