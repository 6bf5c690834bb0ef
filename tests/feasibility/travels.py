"""Travels one by one, as schedulers route many at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.feasibility.clearance_kernels import PackedHead
from decmcts.feasibility.packed_head import pack_contours, pack_head
from decmcts.print.contours import Contours
from decmcts.print.loops import enter_at
from decmcts.print.machine import Head
from decmcts.print.toolpath import Toolpath, endpoints, entries_by_contour
from decmcts.team.schedule.routes_kernels import (
    EMPTY,
    HeightField,
    deposit,
    travel_height_above,
)
from decmcts.team.schedule.travels import CELL_MM, new_height_field


def deposit_contour(
    field: HeightField, contours: Contours, contour: int, *, clearance_mm: float
) -> None:
    """Add one printed contour to the field, in place."""
    deposit(
        field,
        contours.points,
        int(contours.offsets[contour]),
        int(contours.offsets[contour + 1]),
        clearance_mm + float(contours.width[contour]) / 2,
    )


def travel_height(
    field: HeightField, head: PackedHead, x0: float, y0: float, x1: float, y1: float
) -> float:
    """Return the lowest z at which the nozzle may go straight, -inf where any is safe."""
    return float(travel_height_above(field, head, x0, y0, x1, y1, EMPTY))


def safe_travel_path(
    field: HeightField,
    head: PackedHead,
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    *,
    lift_mm: float,
) -> NDArray[np.float64]:
    """Return the polyline of a travel that clears everything in the field.

    Parameters
    ----------
    field : HeightField
        What is printed by then.
    head : PackedHead
        The head that travels.
    start, end : NDArray[np.float64]
        (3,) nozzle positions, mm. Going straight up from the first and down to
        the second must be safe; for ends of printed and printable contours the
        dependency graph says so.
    lift_mm : float
        Kept above the highest obstacle where the nozzle must rise over it.

    Returns
    -------
    NDArray[np.float64]
        (k, 3); two points where no lift is needed, else up, across and down.
    """
    start, end = np.asarray(start, np.float64), np.asarray(end, np.float64)
    z = max(float(start[2]), float(end[2]))
    across = bool((start[:2] != end[:2]).any())
    if across:
        safe = travel_height_above(field, head, start[0], start[1], end[0], end[1], z)
        z = safe + lift_mm if safe > z else z
    path = [start]
    if across and z > start[2]:
        path.append(np.array([start[0], start[1], z]))
    if across and z > end[2]:
        path.append(np.array([end[0], end[1], z]))
    return np.array([*path, end])


def toolpath_heights(
    contours: Contours,
    toolpath: Toolpath,
    head: Head,
    *,
    clearance_mm: float,
    cell_mm: float = CELL_MM,
) -> NDArray[np.float64]:
    """Return the lowest safe z of each travel of a toolpath, (len(toolpath) - 1,).

    At least the height of both ends of the travel; larger where it must lift.
    """
    field = new_height_field(contours, clearance_mm=clearance_mm, cell_mm=cell_mm)
    running = enter_at(contours, entries_by_contour([toolpath], len(contours)))
    beads = pack_contours(running, clearance_mm)
    entries, exits = endpoints(contours, toolpath)
    packed = pack_head(head)
    heights = np.empty(max(0, len(toolpath) - 1))
    for i, c in enumerate(toolpath.order[:-1]):
        deposit(field, beads.points, beads.offsets[c], beads.offsets[c + 1], beads.radius[c])
        start, end = exits[i], entries[i + 1]
        z = max(start[2], end[2])
        heights[i] = travel_height_above(field, packed, *start[:2], *end[:2], z)
    return heights
