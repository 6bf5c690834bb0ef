"""The path of every travel and retreat: lift, go, lower.

A travel of head r must clear whatever *may* be printed by then in any timing
the partial order allows: all contours of every head not ordered after it (J5).
That set only grows along a head, so one height field a head is enough.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.routes import Beads, Rows, travel_levels
from decmcts._kernels.schedule import UNIT_PRINT, UNIT_YIELD, Visits
from decmcts.feasibility.packed_head import pack_contours, pack_head
from decmcts.feasibility.travel import new_height_field
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.team.order import UnitOrder
from decmcts.team.space import Space


def unit_travels(
    job: PrintJob, machine: Machine, order: UnitOrder, visits: Visits, space: Space
) -> list[NDArray[np.float64]]:
    """Return the path from where the head rests to where each unit works, m of (k, 3).

    A path of one point means that there is nothing to travel.
    """
    starts, goals = _ends(order, visits, space)
    level = np.empty(len(order.head))
    packed = pack_contours(job.contours, machine.clearance_mm)
    beads = Beads(packed.points, packed.offsets, packed.radius)
    units = Rows(order.contour, order.rows, order.counts, order.later)
    stays_up = order.kind == UNIT_YIELD
    for r, head in enumerate(machine.heads):
        field = new_height_field(job.contours, clearance_mm=machine.clearance_mm)
        travel_levels(
            r,
            units,
            starts,
            goals,
            stays_up,
            beads,
            field,
            pack_head(head),
            machine.lift_mm,
            level,
        )
    goals[stays_up, 2] = level[stays_up]
    return _paths(starts, goals, level)


def _ends(
    order: UnitOrder, visits: Visits, space: Space
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where each unit's head comes from and where its travel goes, each (m, 3)."""
    prints = (order.kind == UNIT_PRINT)[:, None]
    goals = np.where(prints, visits.first[order.contour], order.target)
    rests = np.where(prints, visits.last[order.contour], order.target)
    starts = np.empty_like(goals)
    for r in range(len(order.counts)):
        mine = order.rows[r, : order.counts[r]]
        starts[mine[1:]] = rests[mine[:-1]]
        starts[mine[:1]] = space.parks[r]
    return starts, goals


def _paths(
    starts: NDArray[np.float64], goals: NDArray[np.float64], level: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Return start, above start, above goal, goal, without corners that do not move."""
    across = (starts[:, :2] != goals[:, :2]).any(axis=1)
    over = np.stack([starts, starts, goals, goals], axis=1)
    over[:, 1, 2] = np.where(across, level, starts[:, 2])
    over[:, 2, 2] = np.where(across, level, goals[:, 2])
    keep = np.ones((len(over), 4), np.bool_)
    keep[:, 1:] = (np.diff(over, axis=1) != 0.0).any(axis=2)
    return [corners[mask] for corners, mask in zip(over, keep, strict=True)]
