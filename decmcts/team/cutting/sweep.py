"""The joint order of a sweep: strip by strip, all heads in step, layers there and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.engine.sweep import nearest_by_group, not_before, with_stragglers
from decmcts.team.cutting.layout import Cuttable, Layout, Places
from decmcts.team.engine.plans import StatedOrder
from decmcts.team.engine.problem import TeamProblem

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Sweep:
    """The order in which heads sweep all layers."""

    stated: StatedOrder
    run: Ints  # (n,) of each turn: what one head prints of one strip has one number
    late: NDArray[np.bool_]  # (n_source,) some of it is printed at a later step than lies there


def sweep_order(problem: TeamProblem, layout: Layout, places: Places, spread: Cuttable) -> Sweep:
    """Return the order in which the heads sweep the layers.

    At each step the head that is ahead comes first, so that no head waits for one behind it.
    What fits into no step of its layer is printed with the middle that is nearest. What has to
    wait for something may be late.

    Parameters
    ----------
    problem : TeamProblem
        Of the cut print.
    places : Places
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
    head = layout.head(layer, region)
    eligible = problem.space.eligible
    rows = np.arange(len(contours))
    head = np.where(eligible[rows, head], head, np.argmax(eligible, axis=1))
    step = layout.step(layer, region)
    ahead = np.where(layout.forward[layer], layout.heads - 1 - head, head)
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
