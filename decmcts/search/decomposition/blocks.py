"""A sequence, the best windows of several, and a window as a small search problem of its own.

The contours before and after the window belong to the problem too, as *guards* that never
move. So a block that becomes cheaper makes the whole sequence cheaper by exactly as much.
(Where two blocks that touch change at once the travel between them may differ.) The stored
edges inside the window have the same closure as all edges inside it, since any chain between
two of its contours stays within a contiguous window. Nothing is searched here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Int32s, Ints
from decmcts.search.decomposition.blocks_kernels import block_edges, block_ports, crossed
from decmcts.search.sequence.entries_kernels import visits_cost
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.metric_kernels import Metric, points_of, with_points
from decmcts.search.sequence.moves_kernels import Tour, refresh
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.timed_lags import no_lag_state


@dataclass(slots=True)
class Sequence:
    """A complete sequence that blocks are taken from and put back into; mutable."""

    problem: OrderProblem
    metric: Metric
    near: Int32s  # (2n + anchors, k) entry ports near each exit, see `near_ports`
    order: Int32s  # (n,)
    reversed: NDArray[np.uint8]  # (n,) by contour
    entry_id: Int32s  # (n,) by contour

    @classmethod
    def best_of(cls, incumbent: Incumbent, near: Int32s) -> Sequence:
        """Return a copy of the best sequence so far."""
        visits = (incumbent.order.copy(), incumbent.reversed.copy(), incumbent.entry_id.copy())
        return cls(incumbent.problem, incumbent.metric, near, *visits)

    def copy(self) -> Sequence:
        """Return the same sequence, to be changed apart from this one."""
        return replace(
            self,
            order=self.order.copy(),
            reversed=self.reversed.copy(),
            entry_id=self.entry_id.copy(),
        )

    def become(self, other: Sequence) -> None:
        """Mutate the sequence to another of the same problem."""
        self.order[:] = other.order
        self.reversed[:], self.entry_id[:] = other.reversed, other.entry_id

    def offer_to(self, incumbent: Incumbent) -> None:
        """Let the incumbent take it if it is better."""
        incumbent.offer(self.order, self.reversed, self.entry_id)

    def choose_entries(self) -> None:
        """Mutate the sequence: choose the best entries and directions for its order, exactly.

        Moves choose the entry of one loop, or a few; this chooses all at once.
        """
        if self.problem.seams is not None:
            self.reversed[:], self.entry_id[:] = self.problem.visits_for(self.metric, self.order)

    @property
    def cost(self) -> float:
        """What its travels cost together."""
        return float(visits_cost(self.metric, self.order, self.reversed, self.entry_id))


def crossover(sequences: list[Sequence]) -> Sequence:
    """Return the cheapest sequence of windows of those given; no dearer than any.

    So what threads found in different places is kept together (partition crossover). All are
    of one problem, and none is changed. A window ends where two of them have printed the same
    set of contours, see `crossed`.

    References
    ----------
    Whitley, Hains & Howe 2009, "Tunneling between optima: partition crossover for the
    traveling salesman problem" (independent parts are chosen one by one).
    """
    best = sequences[0].copy()
    if len(sequences) == 1:
        return best
    order, is_reversed, entry_id = (
        np.stack([getattr(sequence, name) for sequence in sequences])
        for name in ("order", "reversed", "entry_id")
    )
    followed = crossed(best.metric, order, is_reversed, entry_id)
    best.order[:] = order[followed, np.arange(len(followed))]
    best.reversed[best.order], best.entry_id[best.order] = (
        is_reversed[followed, best.order],
        entry_id[followed, best.order],
    )
    return best


@dataclass(frozen=True, slots=True)
class SequenceBlock:
    """Positions [first, last) of a sequence, with a guard on each side that has one."""

    first: int
    ids: Int32s  # (k,) contour of each local number, guards included
    entries: Ints  # number in the whole problem of each local entry
    guards: tuple[int, int]  # 0 or 1 before and behind
    tour: Tour  # local numbers are positions at the time of cutting

    def twin(self) -> SequenceBlock:
        """Return the same block, to be changed apart from this one."""
        tour, own = self.tour, self.tour.metric
        if len(self.entries):
            own = with_points(own, points_of(own).copy())
        twin = tour._replace(
            metric=own,
            entry_id=tour.entry_id.copy(),
            order=tour.order.copy(),
            position=tour.position.copy(),
            reversed=tour.reversed.copy(),
            after=tour.after.copy(),
            scratch=tour.scratch.copy(),
            mark=tour.mark.copy(),
            lags=tour.lags._replace(begin=tour.lags.begin.copy()),
        )
        return replace(self, tour=twin)

    def within(self, group: Int32s) -> SequenceBlock:
        """Return the block with moves only within equal `group`, (n,) by contour."""
        return replace(self, tour=self.tour._replace(group=group[self.ids]))

    def put_back(self, sequence: Sequence) -> None:
        """Mutate the sequence: print these positions as the block does now."""
        inner = self.tour.order[self.guards[0] : len(self.ids) - self.guards[1]]
        sequence.order[self.first : self.first + len(inner)] = self.ids[inner]
        sequence.reversed[self.ids[inner]] = self.tour.reversed[inner]
        if len(self.entries):
            entered = self.tour.entry_id >= 0
            sequence.entry_id[self.ids[entered]] = self.entries[self.tour.entry_id[entered]]


def cut(sequence: Sequence, first: int, last: int) -> SequenceBlock:
    """Return positions [first, last) as a block.

    Takes time in proportion to all contours and entries, and to the edges of the block.

    Raises
    ------
    ValueError
        If it is not the whole sequence where the problem has time lags: what is due
        across a cut would be lost.
    """
    n, timed_lags = len(sequence.order), sequence.problem.timed_lags
    if timed_lags is not None and last - first < n:
        raise ValueError("a part of a sequence cannot keep time with the rest of it")
    guards = (int(first > 0), int(last < n))
    ids = sequence.order[first - guards[0] : last + guards[1]].copy()
    k = len(ids)
    graph = sequence.problem.graph
    pred_offsets, preds, succ_offsets, succs = block_edges(
        graph.pred_offsets, graph.preds, graph.succ_offsets, graph.succs,
        ids, guards[0], k - guards[1],
    )  # fmt: skip
    reversible = sequence.problem.reversible[ids]
    reversible[: guards[0]] = reversible[k - guards[1] :] = False
    seams = _block_seams(sequence, ids, guards)
    own = np.arange(k, dtype=np.int32)
    tour = Tour(
        metric=seams.metric,
        reversible=reversible,
        group=np.zeros(k, np.int32),
        pred_offsets=pred_offsets,
        preds=preds,
        succ_offsets=succ_offsets,
        succs=succs,
        near=_block_near(sequence, ids, seams),
        entry_offsets=seams.offsets,
        entry_owner=seams.owner,
        entry_row=seams.row,
        entry_id=seams.entry_id,
        order=own,
        position=own.copy(),
        reversed=sequence.reversed[ids],
        after=np.zeros(k),
        scratch=np.empty(k, np.int32),
        mark=np.zeros(k, np.bool_),
        lags=no_lag_state() if timed_lags is None else timed_lags.state(own, ids),
    )
    refresh(tour, 0, k)
    return SequenceBlock(first, ids, seams.entries, guards, tour)


class _BlockSeams(NamedTuple):
    """The metric and the entries of a block, in local numbers."""

    metric: Metric
    entries: Ints  # (m,) number in the whole problem
    offsets: Ints  # (k + 1,)
    owner: Int32s  # (m,)
    row: Int32s  # (m,)
    rows: Ints  # rows of the whole near lists that the block needs
    entry_id: Int32s  # (k,)


def _block_seams(sequence: Sequence, ids: Int32s, guards: tuple[int, int]) -> _BlockSeams:
    """Return what a block of these contours needs of the problem's entries.

    Guards have none: they stay as they are.
    """
    k, seams = len(ids), sequence.problem.seams
    rows = np.stack([2 * ids, 2 * ids + 1], axis=1).ravel().astype(np.int64)
    none = np.empty(0, np.int32)
    if seams is None:
        metric = with_points(sequence.metric, points_of(sequence.metric)[rows])
        empty, entry_id = np.empty(0, np.int64), np.full(k, -1, np.int32)
        return _BlockSeams(metric, empty, np.zeros(k + 1, np.int64), none, none, rows, entry_id)
    n, counts, old = len(sequence.order), np.diff(seams.offsets)[ids], sequence.entry_id[ids]
    counts[: guards[0]] = counts[k - guards[1] :] = 0
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    entries = np.repeat(seams.offsets[ids] - offsets[:-1], counts) + np.arange(offsets[-1])
    owner = np.repeat(np.arange(k, dtype=np.int32), counts)
    chosen = counts[owner] > 1
    kept, dense = np.unique(seams.rows[entries[chosen]], return_inverse=True)
    row = np.full(len(entries), -1, np.int32)
    row[chosen] = 2 * k + dense
    entry_ports = 2 * n + np.stack([2 * entries, 2 * entries + 1], axis=1).ravel()
    points = points_of(sequence.metric)[np.concatenate([rows, entry_ports])]
    for guard in np.flatnonzero((counts == 0) & (old >= 0)):
        entry_port = 2 * n + 2 * old[guard]
        points[2 * guard : 2 * guard + 2] = points_of(sequence.metric)[entry_port : entry_port + 2]
    free = (old >= 0) & (counts > 0)
    entry_id = np.where(free, old - seams.offsets[ids] + offsets[:-1], -1).astype(np.int32)
    entered = np.flatnonzero(free)  # these have the ports of their entry
    door = 2 * k + 2 * entry_id[entered]
    points[2 * entered], points[2 * entered + 1] = points[door], points[door + 1]
    metric = with_points(sequence.metric, points)
    return _BlockSeams(metric, entries, offsets, owner, row, np.concatenate([rows, kept]), entry_id)


def _block_near(sequence: Sequence, ids: Int32s, seams: _BlockSeams) -> Int32s:
    """Return the near ports in local numbers; those inside are repeated to fill the lists.

    A proposal drawn from a list then never falls outside the block.
    """
    local, place = np.full(len(sequence.order), -1, np.int32), np.empty(0, np.int32)
    local[ids] = np.arange(len(ids), dtype=np.int32)
    if sequence.problem.seams is not None:
        place = np.full(int(sequence.problem.seams.offsets[-1]), -1, np.int32)
        place[seams.entries] = np.arange(len(seams.entries), dtype=np.int32)
    return block_ports(sequence.near, seams.rows, local, place, len(ids))
