"""A stretch of a sequence as a small search problem of its own.

The contours next to it stay as guards at its ends, so that what is gained inside
is gained in the whole sequence, to the bit; but where pieces that touch are changed
at once, the travel between them becomes what neither saw. Since the stretch is
contiguous in a linear extension, the stored edges inside it have the closure of all
edges inside it: any chain between two of its contours stays within. Nothing is
searched here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.sequence.inner import inner_edges, inner_ports
from decmcts._kernels.sequence.metric import Metric, points_of, restricted, with_points
from decmcts._kernels.sequence.moves import Tour, refresh
from decmcts._kernels.sequence.seats import sit_all, visits_cost
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.spacing import no_pauses


@dataclass(slots=True)
class Sequence:
    """A complete sequence that pieces are taken from and put back into; mutable."""

    problem: OrderProblem
    metric: Metric
    near: NDArray[np.int32]  # (2n + anchors, k) entry ports near each exit, see `near_ports`
    order: NDArray[np.int32]  # (n,)
    flip: NDArray[np.uint8]  # (n,) by contour
    seat: NDArray[np.int32]  # (n,) by contour

    @classmethod
    def best_of(cls, incumbent: Incumbent, near: NDArray[np.int32]) -> Sequence:
        """Return a copy of the best sequence so far."""
        visits = (incumbent.order.copy(), incumbent.flip.copy(), incumbent.seat.copy())
        return cls(incumbent.problem, incumbent.metric, near, *visits)

    def copy(self) -> Sequence:
        """Return the same sequence, to be changed apart from this one."""
        return replace(self, order=self.order.copy(), flip=self.flip.copy(), seat=self.seat.copy())

    def become(self, other: Sequence) -> None:
        """Mutate the sequence to another of the same problem."""
        self.order[:], self.flip[:], self.seat[:] = other.order, other.flip, other.seat

    def settle(self) -> None:
        """Mutate the sequence: loops with a choice are entered where it suits the order best.

        Moves enter one loop anew, or a few; this all of them at once, exactly.
        """
        if self.problem.seams is not None:
            self.flip[:], self.seat[:] = self.problem.visits_for(self.metric, self.order)

    @property
    def cost(self) -> float:
        """What its travels cost together."""
        return float(visits_cost(self.metric, self.order, self.flip, self.seat))


@dataclass(frozen=True, slots=True)
class Piece:
    """Positions [first, last) of a sequence, with a guard on each side that has one."""

    first: int
    ids: NDArray[np.int32]  # (k,) contour of each local number, guards included
    options: NDArray[np.int64]  # number in the whole problem of each local option
    guards: tuple[int, int]  # 0 or 1 before and behind
    tour: Tour  # local numbers are positions at the time of cutting

    def twin(self) -> Piece:
        """Return the same piece, to be changed apart from this one."""
        tour, own = self.tour, self.tour.metric
        if len(self.options):
            own = with_points(own, points_of(own).copy())
        twin = tour._replace(
            metric=own,
            seat=tour.seat.copy(),
            order=tour.order.copy(),
            position=tour.position.copy(),
            flip=tour.flip.copy(),
            after=tour.after.copy(),
            scratch=tour.scratch.copy(),
            mark=tour.mark.copy(),
            pauses=tour.pauses._replace(begin=tour.pauses.begin.copy()),
        )
        return replace(self, tour=twin)

    def within(self, group: NDArray[np.int32]) -> Piece:
        """Return the piece with moves only within equal `group`, (n,) by contour."""
        return replace(self, tour=self.tour._replace(group=group[self.ids]))

    def put_back(self, sequence: Sequence) -> None:
        """Mutate the sequence: print these positions as the piece does now."""
        inner = self.tour.order[self.guards[0] : len(self.ids) - self.guards[1]]
        sequence.order[self.first : self.first + len(inner)] = self.ids[inner]
        sequence.flip[self.ids[inner]] = self.tour.flip[inner]
        if len(self.options):
            seated = self.tour.seat >= 0
            sequence.seat[self.ids[seated]] = self.options[self.tour.seat[seated]]


def cut(sequence: Sequence, first: int, last: int) -> Piece:
    """Return positions [first, last) as a piece. O(contours and edges of the piece).

    Raises
    ------
    ValueError
        If it is not the whole sequence where the problem has a spacing: what is due
        across a cut would be lost.
    """
    n, spacing = len(sequence.order), sequence.problem.spacing
    if spacing is not None and last - first < n:
        raise ValueError("a part of a sequence cannot keep time with the rest of it")
    guards = (int(first > 0), int(last < n))
    ids = sequence.order[first - guards[0] : last + guards[1]].copy()
    k = len(ids)
    graph = sequence.problem.graph
    pred_offsets, preds, succ_offsets, succs = inner_edges(
        graph.pred_offsets, graph.preds, graph.succ_offsets, graph.succs,
        ids, guards[0], k - guards[1],
    )  # fmt: skip
    turns = sequence.problem.reversible[ids]
    turns[: guards[0]] = turns[k - guards[1] :] = False
    seams = _inner_seams(sequence, ids, guards)
    own = np.arange(k, dtype=np.int32)
    tour = Tour(
        seams.metric,
        turns,
        np.zeros(k, np.int32),
        pred_offsets,
        preds,
        succ_offsets,
        succs,
        _inner_near(sequence, ids, seams),
        seams.offsets,
        seams.owner,
        seams.row,
        seams.seat,
        own,
        own.copy(),
        sequence.flip[ids],
        np.zeros(k),
        np.empty(k, np.int32),
        np.zeros(k, np.bool_),
        no_pauses() if spacing is None else spacing.pauses(own, ids),
    )
    refresh(tour, 0, k)
    return Piece(first, ids, seams.options, guards, tour)


class _InnerSeams(NamedTuple):
    """The metric and the options of a piece, in local numbers."""

    metric: Metric
    options: NDArray[np.int64]  # (m,) number in the whole problem
    offsets: NDArray[np.int64]  # (k + 1,)
    owner: NDArray[np.int32]  # (m,)
    row: NDArray[np.int32]  # (m,)
    rows: NDArray[np.int64]  # rows of the whole near lists that the piece needs
    seat: NDArray[np.int32]  # (k,)


def _inner_seams(
    sequence: Sequence, ids: NDArray[np.int32], guards: tuple[int, int]
) -> _InnerSeams:
    """Return what a piece of these contours needs of the problem's options.

    Guards have none: they stay as they are.
    """
    k, seams = len(ids), sequence.problem.seams
    rows = np.stack([2 * ids, 2 * ids + 1], axis=1).ravel().astype(np.int64)
    none = np.empty(0, np.int32)
    if seams is None:
        metric, seat = restricted(sequence.metric, ids), np.full(k, -1, np.int32)
        empty = np.empty(0, np.int64)
        return _InnerSeams(metric, empty, np.zeros(k + 1, np.int64), none, none, rows, seat)
    n, counts, old = len(sequence.order), np.diff(seams.offsets)[ids], sequence.seat[ids]
    counts[: guards[0]] = counts[k - guards[1] :] = 0
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    options = np.repeat(seams.offsets[ids] - offsets[:-1], counts) + np.arange(offsets[-1])
    owner = np.repeat(np.arange(k, dtype=np.int32), counts)
    chosen = counts[owner] > 1
    kept, dense = np.unique(seams.rows[options[chosen]], return_inverse=True)
    row = np.full(len(options), -1, np.int32)
    row[chosen] = 2 * k + dense
    doors = 2 * n + np.stack([2 * options, 2 * options + 1], axis=1).ravel()
    points = points_of(sequence.metric)[np.concatenate([rows, doors])]
    for guard in np.flatnonzero((counts == 0) & (old >= 0)):
        door = 2 * n + 2 * old[guard]
        points[2 * guard : 2 * guard + 2] = points_of(sequence.metric)[door : door + 2]
    free = (old >= 0) & (counts > 0)
    seat = np.where(free, old - seams.offsets[ids] + offsets[:-1], -1).astype(np.int32)
    sit_all(points, seat)
    metric = with_points(sequence.metric, points)
    return _InnerSeams(metric, options, offsets, owner, row, np.concatenate([rows, kept]), seat)


def _inner_near(
    sequence: Sequence, ids: NDArray[np.int32], seams: _InnerSeams
) -> NDArray[np.int32]:
    """Return the near ports in local numbers; those inside are repeated to fill the lists.

    A proposal drawn from a list then never falls outside the piece.
    """
    local, place = np.full(len(sequence.order), -1, np.int32), np.empty(0, np.int32)
    local[ids] = np.arange(len(ids), dtype=np.int32)
    if sequence.problem.seams is not None:
        place = np.full(int(sequence.problem.seams.offsets[-1]), -1, np.int32)
        place[seams.options] = np.arange(len(seams.options), dtype=np.int32)
    return inner_ports(sequence.near, seams.rows, local, place, len(ids))
