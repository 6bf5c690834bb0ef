"""Runs of a sequence contracted to single contours: what is left to search is small.

All but a neighbourhood is contracted, to search that alone
(`decmcts.search.hybrid.neighbourhoods`). Few, partly long contours are left, on which annealing
moves large structure for next to no time. A run is printed as it is, or reversed where all of
it may be. Contours that stay single keep their freedoms.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.sequence.metric import points_of
from decmcts.feasibility.graph import DependencyGraph
from decmcts.search.decomposition.blocks import Sequence
from decmcts.search.sequence.neighbours import near_ports
from decmcts.search.sequence.problem import OrderProblem, Seams


@dataclass(frozen=True, slots=True)
class Contraction:
    """A sequence's problem with runs contracted; run r of `whole` is its contour r."""

    whole: Sequence
    problem: OrderProblem
    begins: NDArray[np.int64]  # (runs + 1,) positions in `whole`
    entries: NDArray[np.int64]  # (m,) number in the whole problem of each entry of single ones

    def start(self) -> Sequence:
        """Return the small problem's sequence that is `whole`."""
        runs, seams = len(self.problem), self.problem.seams
        entry_id = np.full(runs, -1, np.int32)
        if seams is not None:
            used = self.whole.entry_id[self.whole.order[self.begins[:-1]]]
            chosen = np.diff(seams.offsets) > 1
            first = seams.offsets[:-1][chosen]
            entry_id[chosen] = used[chosen] - self.entries[first] + first
        return Sequence(
            self.problem,
            self.problem.metric(),
            near_ports(self.problem),
            np.arange(runs, dtype=np.int32),
            np.zeros(runs, np.uint8),
            entry_id,
        )

    def expanded(self, small: Sequence) -> Sequence:
        """Return the sequence of all contours that one of the small problem stands for."""
        whole, sizes = self.whole, np.diff(self.begins)[small.order]
        in_reverse = np.repeat(small.reversed[small.order] == 1, sizes)
        place = np.arange(len(whole.order)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        first = np.repeat(self.begins[small.order], sizes)
        last = np.repeat(self.begins[small.order + 1] - 1, sizes)
        order = whole.order[np.where(in_reverse, last - place, first + place)]
        is_reversed, entry_id = whole.reversed.copy(), whole.entry_id.copy()
        is_reversed[order[in_reverse]] ^= 1
        entered = np.flatnonzero(small.entry_id >= 0)
        entry_id[whole.order[self.begins[entered]]] = self.entries[small.entry_id[entered]]
        return Sequence(whole.problem, whole.metric, whole.near, order, is_reversed, entry_id)


def contract(sequence: Sequence, together: NDArray[np.bool_]) -> Contraction:
    """Contract the contours at positions p and p + 1 for which `together[p]`, (n - 1,).

    Stored edges suffice: a run is contiguous in a linear extension, so a chain of edges
    between two of its contours stays within, and one from run to run is a chain of runs.
    """
    whole, order = sequence.problem, sequence.order
    begins = np.flatnonzero(np.concatenate([[True], ~together, [True]])).astype(np.int64)
    k = len(begins) - 1
    run = np.empty(len(order), np.int32)
    run[order] = np.repeat(np.arange(k), np.diff(begins))
    pairs = run[whole.graph.pairs()].astype(np.int64)
    inner = pairs[:, 0] == pairs[:, 1]
    reversible = np.ones(k, np.bool_)
    np.logical_and.at(reversible, run, whole.reversible)
    reversible[pairs[inner, 0]] = False
    outer = np.unique(pairs[~inner, 0] * k + pairs[~inner, 1])
    graph = DependencyGraph.from_pairs(k, np.stack([outer // k, outer % k], axis=1))
    first, last = order[begins[:-1]], order[begins[1:] - 1]
    start, end, costs = _ends(sequence, first, 0), _ends(sequence, last, 1), whole.costs
    seams, entries = _seams(whole.seams, first, np.diff(begins) == 1, start, end)
    problem = OrderProblem(
        start,
        end,
        reversible,
        np.zeros(k, np.int32),
        graph,
        pace=whole.pace,
        costs=None if costs is None else costs[np.ix_(last, first)],
        seams=seams,
    )
    return Contraction(sequence, problem, begins, entries)


def _ends(sequence: Sequence, contours: NDArray[np.int32], leaving: int) -> NDArray[np.float64]:
    """Return where contours are entered (0) or left (1), (k, 3); bare costs have no places."""
    if sequence.problem.costs is not None:
        return np.zeros((len(contours), 3))
    entry_id, is_reversed = sequence.entry_id[contours], sequence.reversed[contours]
    port = 2 * contours + (is_reversed ^ leaving)
    entry_port = 2 * len(sequence.order) + 2 * entry_id + leaving
    return np.ascontiguousarray(
        points_of(sequence.metric)[np.where(entry_id >= 0, entry_port, port)]
    )


def _seams(
    seams: Seams | None,
    first: NDArray[np.int32],
    single: NDArray[np.bool_],
    start: NDArray[np.float64],
    end: NDArray[np.float64],
) -> tuple[Seams | None, NDArray[np.int64]]:
    """Return the entries of runs, and their numbers in the whole problem.

    Those of single contours are kept; a longer run has one, from `start` to `end`.
    """
    if seams is None:
        return None, np.empty(0, np.int64)
    counts = np.where(single, np.diff(seams.offsets)[first], 1)
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    entries = np.repeat(seams.offsets[first] - offsets[:-1], counts) + np.arange(offsets[-1])
    enter, leave, one = seams.enter[entries], seams.leave[entries], offsets[:-1][counts == 1]
    enter[one], leave[one] = start[counts == 1], end[counts == 1]
    return Seams(offsets, enter, leave, seams.vertices[entries]), entries
