"""The travels of a sweep made shorter: each head's run of pieces put in a better order.

A *run* is what one head prints, one after the other, of one strip. Nothing leaves its run, so
heads stay in step and as far apart as they were.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
from numpy.typing import NDArray

from decmcts.feasibility.graph import DependencyGraph
from decmcts.random_kernels import seeded
from decmcts.search.decomposition.blocks import Sequence, cut
from decmcts.search.sequence.anneal_kernels import anneal
from decmcts.search.sequence.neighbours import near_ports
from decmcts.search.sequence.problem import OrderProblem, Pace
from decmcts.team.engine.plans import StatedOrder
from decmcts.team.engine.problem import TeamProblem

BLOCK = 200  # contours annealed at a time, or a whole run: few enough for a processor's cache
STEPS = 300  # for each contour
TEMPERATURES = 30
HOT, COLD = 0.5, 0.03  # first and last, in mean travels

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


def with_less_travel(problem: TeamProblem, stated: StatedOrder, run: Ints) -> StatedOrder:
    """Return the joint order with the contours of each run in an order of less travel.

    Parameters
    ----------
    run : (n,)
        Of each turn of the order, non-decreasing; all of a run is one head's.
    """
    order, is_reversed = stated.order.copy(), stated.reversed.copy()
    turns = [np.flatnonzero(stated.head == r) for r in range(len(problem.machine.heads))]
    with ThreadPoolExecutor(len(turns)) as pool:
        found = list(pool.map(partial(_of_head, problem, stated, run), range(len(turns)), turns))
    for mine, (place, turned) in zip(turns, found, strict=True):
        order[mine] = stated.order[mine[place]]
        is_reversed[mine] = stated.reversed[mine[place]] ^ turned
    return StatedOrder(order, is_reversed, stated.head)


def _of_head(
    problem: TeamProblem, stated: StatedOrder, run: Ints, head: int, turns: Ints
) -> tuple[Ints, Flags]:
    """Return in which order one head takes its turns, and which run the other way, (k,) each."""
    k = len(turns)
    if k == 0:
        return np.empty(0, np.int64), np.empty(0, np.bool_)
    sequence = _sequence_of(problem, stated, head, turns)
    mean, state = sequence.cost / k, seeded(head)
    number = (np.cumsum(np.diff(run[turns], prepend=run[turns[0]]) > 0)).astype(np.int32)
    begins, first = np.flatnonzero(np.diff(number, prepend=-1)), 0
    while first < k:
        behind = np.searchsorted(begins, first + BLOCK)
        last = int(begins[behind]) if behind < len(begins) else k
        block = cut(sequence, first, last).within(number)
        steps = max(1, STEPS * (last - first) // TEMPERATURES)
        for share in np.linspace(0.0, 1.0, TEMPERATURES):
            anneal(block.tour, state, mean * HOT * (COLD / HOT) ** share, steps)
        block.put_back(sequence)
        first = last
    return sequence.order.astype(np.int64), sequence.reversed[sequence.order].astype(np.bool_)


def _sequence_of(problem: TeamProblem, stated: StatedOrder, head: int, turns: Ints) -> Sequence:
    """Return one head's contours as a sequence, numbered and directed as in the joint order."""
    ids, k = stated.order[turns], len(turns)
    number = np.full(len(stated.order), -1)
    number[ids] = np.arange(k)
    pairs = number[problem.graph.pairs()]
    graph = DependencyGraph.from_pairs(k, pairs[(pairs >= 0).all(axis=1)].astype(np.int32))
    backwards = stated.reversed[turns].astype(np.int64)
    rows, ends = np.arange(k), problem.visits.ends[ids]
    alone = OrderProblem(
        ends[rows, backwards], ends[rows, 1 - backwards], problem.visits.reversible[ids],
        problem.job.contours.layer[ids].astype(np.int32), graph,
        pace=Pace(*problem.fleet.travel[head].tolist()),
    )  # fmt: skip
    return Sequence(
        alone, alone.metric(), near_ports(alone),
        np.arange(k, dtype=np.int32), np.zeros(k, np.uint8), np.full(k, -1, np.int32),
    )  # fmt: skip
