"""Two good sequences of one problem: what they share becomes one contour, the rest is searched.

Runs of contours that both print in a row, in the same directions, are fused. What
is left is a problem with few, long contours, on which annealing moves what
distinguishes the two: large structure, for next to no time.

References
----------
Cook & Seymour 2003, "Tour merging via branch-decomposition" (what good tours share).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.metric import points_of
from decmcts.feasibility.graph import DependencyGraph
from decmcts.search.neighbours import near_ports
from decmcts.search.pieces import Sequence
from decmcts.search.problem import OrderProblem


@dataclass(frozen=True, slots=True)
class Merger:
    """The fused problem of two sequences; run r of `whole` is its contour r."""

    whole: Sequence
    problem: OrderProblem
    begins: NDArray[np.int64]  # (runs + 1,) positions in `whole`

    def start(self) -> Sequence:
        """Return the fused problem's sequence that is `whole`."""
        runs = len(self.problem)
        return Sequence(
            self.problem,
            self.problem.metric(),
            near_ports(self.problem),
            np.arange(runs, dtype=np.int32),
            np.zeros(runs, np.uint8),
            np.full(runs, -1, np.int32),
        )

    def unfused(self, fused: Sequence) -> Sequence:
        """Return the sequence of all contours that a fused one stands for."""
        whole, sizes = self.whole, np.diff(self.begins)[fused.order]
        backwards = np.repeat(fused.flip[fused.order] == 1, sizes)
        place = np.arange(len(whole.order)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        first = np.repeat(self.begins[fused.order], sizes)
        last = np.repeat(self.begins[fused.order + 1] - 1, sizes)
        order = whole.order[np.where(backwards, last - place, first + place)]
        flip = whole.flip.copy()
        flip[order[backwards]] ^= 1
        return Sequence(whole.problem, whole.metric, whole.near, order, flip, whole.seat.copy())


def merge(one: Sequence, other: Sequence) -> Merger:
    """Return the problem in which all that two sequences share is fused, as `one` has it."""
    fused = _shared(one, other)
    begins = np.flatnonzero(np.concatenate([[True], ~fused, [True]]))
    run = np.empty(len(one.order), np.int32)
    run[one.order] = np.repeat(np.arange(len(begins) - 1), np.diff(begins))
    pairs = run[one.problem.graph.pairs()]
    inner = pairs[:, 0] == pairs[:, 1]
    turns = np.ones(len(begins) - 1, np.bool_)
    np.logical_and.at(turns, run, one.problem.reversible)
    turns[pairs[inner, 0]] = False
    graph = DependencyGraph.from_pairs(len(turns), np.unique(pairs[~inner], axis=0))
    first, last = one.order[begins[:-1]], one.order[begins[1:] - 1]
    costs = one.problem.costs
    problem = OrderProblem(
        _ends(one, first, 0),
        _ends(one, last, 1),
        turns,
        np.zeros(len(turns), np.int32),
        graph,
        pace=one.problem.pace,
        costs=None if costs is None else costs[np.ix_(last, first)],
    )
    return Merger(one, problem, begins.astype(np.int64))


def _shared(one: Sequence, other: Sequence) -> NDArray[np.bool_]:
    """Tell after which positions of `one` both go on alike, (n - 1,)."""
    follows = np.full(len(one.order), -1, np.int32)
    follows[other.order[:-1]] = other.order[1:]
    alike = one.flip == other.flip
    a, b = one.order[:-1], one.order[1:]
    return np.asarray((follows[a] == b) & alike[a] & alike[b])


def _ends(sequence: Sequence, contours: NDArray[np.int32], leaving: int) -> NDArray[np.float64]:
    """Return where contours are entered (0) or left (1), (k, 3); bare costs have no places."""
    if sequence.problem.costs is not None:
        return np.zeros((len(contours), 3))
    seat, flip = sequence.seat[contours], sequence.flip[contours]
    port = 2 * contours + (flip ^ leaving)
    door = 2 * len(sequence.order) + 2 * seat + leaving
    return np.ascontiguousarray(points_of(sequence.metric)[np.where(seat >= 0, door, port)])
