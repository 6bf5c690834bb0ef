"""The path of every travel and retreat: lift, go, lower.

A travel of head r must clear whatever *may* be printed by then in any timing
the partial order allows: all contours of every head not ordered after it (J5).
That set only grows along a head, so one record a head is enough.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.schedule import UNIT_PRINT, Visits
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.team.order import UnitOrder
from decmcts.team.space import Space


def unit_travels(
    job: PrintJob, machine: Machine, order: UnitOrder, visits: Visits, space: Space
) -> list[NDArray[np.float64]]:
    """Return the path from where the head rests to where each unit works, (m) of (k, 3).

    A path of fewer than two points means that there is nothing to travel.
    """
    tops = job.contours.top if len(job.contours) else np.empty(0)
    heads = len(space.parks)
    rest = space.parks.copy()
    level = np.full(heads, -np.inf)
    seen = np.zeros((heads, heads), np.int64)
    paths: list[NDArray[np.float64]] = []
    for row in range(len(order.head)):
        r = int(order.head[row])
        for s in range(heads):
            upto = int(order.own[row] if s == r else order.later[row, s])
            for k in range(int(seen[r, s]), upto):
                contour = order.contour[order.rows[s, k]]
                if contour >= 0:
                    level[r] = max(level[r], tops[contour])
            seen[r, s] = max(seen[r, s], upto)
        prints = order.kind[row] == UNIT_PRINT
        goal = visits.first[order.contour[row]] if prints else order.target[row]
        above = level[r] + machine.lift_mm
        paths.append(_up_over_down(rest[r], goal, above))
        rest[r] = visits.last[order.contour[row]] if prints else paths[-1][-1]
    return paths


def _up_over_down(
    start: NDArray[np.float64], goal: NDArray[np.float64], above: float
) -> NDArray[np.float64]:
    """Return the polyline that rises to at least `above`, crosses and comes down."""
    if np.array_equal(start, goal):
        return start[None, :]
    level = max(float(start[2]), float(goal[2]), above)
    corners = [start, [start[0], start[1], level], [goal[0], goal[1], level], goal]
    path = np.array(corners, np.float64)
    keep = np.concatenate([[True], (np.diff(path, axis=0) != 0.0).any(axis=1)])
    return np.asarray(path[keep])
