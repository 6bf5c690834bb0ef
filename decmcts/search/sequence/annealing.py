"""Annealing of a whole sequence, and descent to its local optimum.

Both take small steps, and look after each whether the search is to end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.sequence.anneal import anneal
from decmcts._kernels.sequence.descent import descend
from decmcts._kernels.sequence.entries import use_entries
from decmcts._kernels.sequence.metric import points_of
from decmcts._kernels.sequence.moves import Tour, refresh
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.stopping import POLL_S, next_chunk
from decmcts.search.sequence.timed_lags import no_lag_state

DESCENT_FROM = 0.97  # share of a search at which what is drawn at random ends

_LEAST_CHUNK, _LARGEST_CHUNK = 1000, 1_000_000  # proposals
_CHUNKS = 400  # parts of a run that is limited by iterations
_POSITIONS = 500  # positions between looks at the clock in a descent
_LONGEST_SWAP = 50  # segments tried exhaustively; longer ones are left to annealing


@dataclass(frozen=True, slots=True)
class TemperatureSchedule:
    """A temperature that falls geometrically, in the unit of costs."""

    first: float
    last: float

    def at(self, share: float) -> float:
        """Return the temperature after `share` (0..1) of the run."""
        return float(self.first * (self.last / self.first) ** min(max(share, 0.0), 1.0))


def tour_of(
    incumbent: Incumbent, near: NDArray[np.int32], group: NDArray[np.int32] | None = None
) -> Tour:
    """Return a mutable copy of the incumbent; moves stay within equal `group`."""
    problem, graph, n = incumbent.problem, incumbent.problem.graph, len(incumbent.problem)
    metric, seams, timed_lags = problem.metric(), problem.seams, problem.timed_lags
    every = np.arange(n, dtype=np.int32)
    if seams is not None:
        use_entries(points_of(metric), incumbent.entry_id)
    position = np.empty(n, np.int32)
    position[incumbent.order] = every
    tour = Tour(
        metric=metric,
        reversible=problem.reversible.copy(),  # writable, as in blocks: kernels are compiled once
        group=np.zeros(n, np.int32) if group is None else group,
        pred_offsets=graph.pred_offsets,
        preds=graph.preds,
        succ_offsets=graph.succ_offsets,
        succs=graph.succs,
        near=near,
        entry_offsets=np.zeros(n + 1, np.int64) if seams is None else seams.offsets,
        entry_owner=np.empty(0, np.int32) if seams is None else seams.owner,
        entry_row=np.empty(0, np.int32) if seams is None else seams.rows,
        entry_id=incumbent.entry_id.copy(),
        order=incumbent.order.copy(),
        position=position,
        reversed=incumbent.reversed.copy(),
        after=np.zeros(n),
        scratch=np.empty(n, np.int32),
        mark=np.zeros(n, np.bool_),
        lags=no_lag_state() if timed_lags is None else timed_lags.state(incumbent.order, every),
    )
    refresh(tour, 0, n)
    return tour


def anneal_until(
    incumbent: Incumbent,
    tour: Tour,
    state: NDArray[np.uint64],
    schedule: TemperatureSchedule,
    until: float,
) -> None:
    """Anneal the tour until the share `until` is spent or the search is over.

    Mutates the tour and the generator state. The sequence is offered to the incumbent
    after each chunk of proposals.
    """
    began, chunk = incumbent.spent, _LEAST_CHUNK
    limit = incumbent.stopping.iterations
    if limit is not None:
        left = (until - began) * limit
        chunk = int(min(max(left / _CHUNKS, 1.0), _LARGEST_CHUNK))
    while not incumbent.over and (spent := incumbent.spent) < until:
        share = (spent - began) / (until - began)
        before = incumbent.seconds
        anneal(tour, state, schedule.at(share), chunk)
        incumbent.iterations += chunk
        incumbent.offer(tour.order, tour.reversed, tour.entry_id)
        incumbent.tick()
        if limit is None:
            took_s = incumbent.seconds - before
            chunk = next_chunk(chunk, took_s, POLL_S, least=_LEAST_CHUNK, most=_LARGEST_CHUNK)


def descend_fully(incumbent: Incumbent, tour: Tour) -> None:
    """Improve the tour until no nearby move does or the search is over.

    Mutates the tour. Each position looked at counts as an iteration.
    """
    n, gain = len(tour.order), -1.0
    while gain < 0.0:
        gain = 0.0
        for first in range(0, n, _POSITIONS):
            gain += descend(tour, first, min(first + _POSITIONS, n), _LONGEST_SWAP)
            incumbent.offer(tour.order, tour.reversed, tour.entry_id)
            incumbent.tick(min(_POSITIONS, n - first))
            if incumbent.over:
                return
