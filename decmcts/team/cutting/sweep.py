"""The joint order of a sweep: strip by strip, all heads in step, layers there and back.

Travels are made shorter run by run. A *run* is what one head prints, one after the other, of one
strip. Nothing leaves its run, so heads stay in step and as far apart as they were.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.feasibility.graph import DependencyGraph
from decmcts.random_kernels import seeded
from decmcts.search.decomposition.blocks import Sequence, cut
from decmcts.search.sequence.anneal_kernels import anneal
from decmcts.search.sequence.neighbours import near_ports
from decmcts.search.sequence.problem import OrderProblem, Pace
from decmcts.team.cutting.layout import Cuttable, Layout, WholeContours
from decmcts.team.engine.plans import StatedOrder
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import units_as_stated
from decmcts.team.engine.sweep_kernels import nearest_by_group, not_before, with_stragglers

BLOCK = 200  # contours annealed at a time, or a whole run: few enough for a processor's cache
STEPS = 300  # for each contour
TEMPERATURES = 30
HOT, COLD = 0.5, 0.03  # first and last, in mean travels


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


@dataclass(frozen=True, slots=True)
class Sweep:
    """The order in which heads sweep all layers."""

    stated: StatedOrder
    run: Ints  # (n,) of each turn: what one head prints of one strip has one number
    late: Flags  # (n_source,) some of it is printed at a later step than lies there


def sweep_order(
    problem: TeamProblem, layout: Layout, places: WholeContours, spread: Cuttable
) -> Sweep:
    """Return the order in which the heads sweep the layers.

    At each step the head that is ahead comes first, so that no head waits for one behind it.
    What fits into no step of its layer is printed with the middle that is nearest. What has to
    wait for something may be late.

    Parameters
    ----------
    problem : TeamProblem
        Of the cut print.
    places : WholeContours
        Of the source's contours.
    spread : Cuttable
        Of the source.
    """
    contours = problem.job.contours
    layer, of = contours.layer.astype(np.int64), contours.sources
    whole = np.bincount(of, minlength=len(places.region))[of] == 1
    depth, fits, may = spread.depth[of], places.fits[of], spread.may[of]
    middle = problem.space.boxes[:, 2 * layout.axis : 2 * layout.axis + 2].mean(axis=1)
    region = np.where(whole & fits, places.region[of], layout.region(layer, depth, middle))
    wide = whole & ~fits & ~may
    region[wide] = layout.nearest_middle(layer[wide], region[wide])
    head = problem.row[layout.place(layer, region)]
    eligible = problem.space.eligible
    rows = np.arange(len(contours))
    head = np.where(eligible[rows, head], head, np.argmax(eligible, axis=1))
    step = layout.step(layer, region)
    place = np.argsort(problem.row)[head]
    ahead = np.where(layout.forward[layer], layout.heads - 1 - place, place)
    size = (layout.steps + 1) * layout.heads
    group = (np.cumsum(size) - size)[layer] + step * layout.heads + ahead
    natural, preds = group.copy(), (problem.graph.pred_offsets, problem.graph.preds)
    not_before(group, *preds)
    first = with_stragglers(natural, group, head, eligible, *preds)
    late = np.zeros(len(places.region), np.bool_)
    late[of[group > natural]] = True
    group = 2 * group + ~first
    order, is_reversed = nearest_by_group(
        group, head, problem.visits.ends, problem.visits.reversible,
        problem.space.parks.copy(), *preds,
    )  # fmt: skip
    run = np.cumsum(np.diff(group[order] * layout.heads + head[order], prepend=-1) != 0)
    return Sweep(StatedOrder(order, is_reversed, head[order]), run, late)


def times_of(problem: TeamProblem, stated: StatedOrder) -> tuple[Floats, float] | None:
    """Return how long heads take for each layer, (layers,), and when all end, s.

    A layer's time is from the end of all below it to its own. None if the heads cannot carry
    the order out.
    """
    units = units_as_stated(problem, stated, range(len(problem.machine.heads)))
    if units is None:
        return None
    used, layer = int(units.used[0]), problem.job.contours.layer
    contour, end = units.contour[:used], units.end[:used]
    ends = np.zeros(int(layer.max(initial=-1)) + 1)
    np.maximum.at(ends, layer[contour[contour >= 0]], end[contour >= 0])
    ends = np.maximum.accumulate(ends)
    return np.diff(ends, prepend=0.0), float(end.max(initial=0.0))
