"""The joint order of a sweep: strip by strip, all heads in step, layers there and back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.engine.sweep import nearest_by_group, not_before
from decmcts.print.contours import Contours
from decmcts.team.cutting.layout import Layout, Places
from decmcts.team.engine.plans import StatedOrder
from decmcts.team.engine.problem import TeamProblem

Ints = NDArray[np.int64]


def sweep_order(problem: TeamProblem, layout: Layout, places: Places, depth: Ints) -> StatedOrder:
    """Return the order in which the heads sweep the layers.

    At each step the head that is ahead comes first, so that no head waits for one behind it.
    What fits into no step of its layer comes after all of them.

    Parameters
    ----------
    problem : TeamProblem
        Of the cut print.
    places : Places
        Of the source's contours; their `depth` is as `decmcts.team.cutting.layout` has it.
    """
    contours = problem.job.contours
    region, whole, wide = _regions(contours, layout, places, depth)
    layer = contours.layer.astype(np.int64)
    head = layout.head(layer, region)
    eligible = problem.space.eligible
    rows = np.arange(len(contours))
    head = np.where(eligible[rows, head], head, np.argmax(eligible, axis=1))
    step = np.where(whole & wide, layout.steps[layer] + 1, layout.step(layer, region))
    ahead = np.where(layout.forward[layer], layout.heads - 1 - head, head)
    size = (layout.steps + 2) * layout.heads
    group = (np.cumsum(size) - size)[layer] + step * layout.heads + ahead
    not_before(group, problem.graph.pred_offsets, problem.graph.preds)
    order, is_reversed = nearest_by_group(
        group, head, problem.visits.ends, problem.visits.reversible, problem.space.parks.copy(),
        problem.graph.pred_offsets, problem.graph.preds,
    )  # fmt: skip
    return StatedOrder(order, is_reversed, head[order])


def _regions(
    contours: Contours, layout: Layout, places: Places, depth: Ints
) -> tuple[Ints, NDArray[np.bool_], NDArray[np.bool_]]:
    """Return of each piece its region, whether it is a whole contour, and whether that is wide."""
    of = contours.sources
    at = contours.points[:, layout.axis]
    low = np.minimum.reduceat(at, contours.offsets[:-1])
    high = np.maximum.reduceat(at, contours.offsets[:-1])
    count = np.bincount(of, minlength=len(places.region))
    whole = count[of] == 1
    mine = layout.region(contours.layer.astype(np.int64), depth[of], (low + high) / 2.0)
    return np.where(whole, places.region[of], mine), whole, ~places.fits[of]
