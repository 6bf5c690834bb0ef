"""The joint order of a sweep: strip by strip, all heads in step, layers there and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts.team.cutting.layout import Cuttable, Layout, WholeContours
from decmcts.team.engine.carry_out_kernels import OK, carry_out
from decmcts.team.engine.order import sequences_of
from decmcts.team.engine.plans import StatedOrder
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import is_allowed
from decmcts.team.engine.sweep_kernels import nearest_by_group, not_before, with_stragglers

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Sweep:
    """The order in which heads sweep all layers."""

    stated: StatedOrder
    run: Ints  # (n,) of each turn: what one head prints of one strip has one number
    late: NDArray[np.bool_]  # (n_source,) some of it is printed at a later step than lies there


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


def times_of(problem: TeamProblem, stated: StatedOrder) -> tuple[NDArray[np.float64], float] | None:
    """Return how long heads take for each layer, (layers,), and when all end, s.

    A layer's time is from the end of all below it to its own. None if the heads cannot carry
    the order out.
    """
    if not is_allowed(problem, stated, problem.space.eligible):
        return None
    sequences = sequences_of(stated.toolpaths(len(problem.machine.heads)))
    units, verdict = carry_out(sequences, problem.visits, problem.fleet)
    if verdict != OK:
        return None
    used, layer = int(units.used[0]), problem.job.contours.layer
    contour, end = units.contour[:used], units.end[:used]
    ends = np.zeros(int(layer.max(initial=-1)) + 1)
    np.maximum.at(ends, layer[contour[contour >= 0]], end[contour >= 0])
    ends = np.maximum.accumulate(ends)
    return np.diff(ends, prepend=0.0), float(end.max(initial=0.0))
