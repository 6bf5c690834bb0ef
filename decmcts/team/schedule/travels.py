"""The path of every travel and retreat: lift, go, lower.

A travel of head r must clear whatever *may* be printed by then in any timing
the partial order allows: all contours of every head not ordered after it (J5).
That set only grows along a head, so one height field a head is enough.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from decmcts.arrays import Floats, Ints
from decmcts.feasibility.packed_head import pack_contours, pack_head
from decmcts.print.contours import Contours, joined
from decmcts.print.detours import Detours
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.walls import bare_pairs, retracted_paths
from decmcts.print.walls_kernels import Walls
from decmcts.team.engine.joint_kernels import UNIT_PRINT
from decmcts.team.engine.waits_kernels import UnitOrder
from decmcts.team.schedule.routes_kernels import (
    EMPTY,
    FANOUT,
    Bends,
    HeightField,
    deposit,
    travel_levels,
)
from decmcts.team.schedule.timing import kinds_of


class Paths(NamedTuple):
    """Polylines, one behind the other."""

    points: Floats  # (offsets[-1], 3) mm
    offsets: Ints  # (m + 1,)


def unit_travels(
    job: PrintJob, machine: Machine, order: UnitOrder, walls: Walls, detours: Detours | None
) -> Paths:
    """Return the path of each unit as if all were travels.

    What a printing unit gets here means nothing; its path is the contour's. A travel
    that stays bare inside `walls` is not lifted, unless something printed is there.
    With `detours` those of one head go round outer walls; several reserve the space of
    straight travels. What is `printed` already is cleared by all of them.
    """
    starts, goals = _starts(order, machine), order.target.copy()
    level = np.zeros(len(order.head))  # units that print keep it
    beads = pack_contours(job.contours, machine.clearance_mm, bead_width=machine.bead_width)
    alone = detours if len(machine.heads) == 1 else None
    bends = _bends(order, alone, starts, goals)
    for r, head in enumerate(machine.heads):
        field = _field(job, machine)
        shape = pack_head(head)
        travel_levels(r, order, starts, goals, bends, beads, field, shape, machine.lift_mm, level)
    np.maximum(level, _hops(job, machine, order, walls, starts, goals, bends), out=level)
    return _paths(starts, goals, bends, level)


def _field(job: PrintJob, machine: Machine) -> HeightField:
    """Return the heights of what stands on the bed before anything is printed."""
    clearance_mm = machine.clearance_mm
    field = new_height_field(joined(job.contours, job.printed), clearance_mm=clearance_mm)
    if job.printed is None:
        return field
    there = pack_contours(job.printed, clearance_mm, bead_width=machine.bead_width)
    for c in range(len(job.printed)):
        first, last = there.offsets[c], there.offsets[c + 1]
        deposit(field, there.points, first, last, there.radius[c])
    return field


def _hops(
    job: PrintJob,
    machine: Machine,
    order: UnitOrder,
    walls: Walls,
    starts: Floats,
    goals: Floats,
    bends: Bends,
) -> Floats:
    """Return how high the source's own habit lifts retracted travels, as far as heads reach, (m,).

    Beads curl up, so a source that lifts over them has a reason.
    """
    ends = np.maximum(starts[:, 2], goals[:, 2])
    far = np.hypot(*(goals - starts)[:, :2].T) >= job.settings.retract_min_travel_mm
    far &= ~bare_pairs(
        walls, job.settings.bare_inside_mm, starts, goals, climb_mm=job.settings.bare_climb_mm
    )
    bent = np.flatnonzero(np.diff(bends.offsets))
    if len(bent):
        bowed = _paths(starts[bent], goals[bent], _of(bends, bent), ends[bent])
        far[bent] = retracted_paths(walls, job.settings, bowed.points, bowed.offsets)
    top = np.array([head.reach_max[2] for head in machine.heads])[order.head]
    lifted = np.minimum(ends + _hop_of(job, order), np.maximum(top, ends))
    return np.where(far, lifted, ends)


def _hop_of(job: PrintJob, order: UnitOrder) -> Floats:
    """Return how far the source lifts each unit with the tool its head prints with next, (m,)."""
    each = np.array([settings.hop_mm for settings in job.settings.each()])
    hops = np.empty(len(order.head))
    for r in range(len(order.counts)):
        mine = order.of_head(r)
        hops[mine] = each[kinds_of(job, order.contour[mine])]
    return hops


def _starts(order: UnitOrder, machine: Machine) -> Floats:
    """Return where the head stands before each unit, (m, 3)."""
    starts = np.empty_like(order.target)
    for r, head in enumerate(machine.heads):
        mine = order.of_head(r)
        starts[mine[1:]] = order.target[mine[:-1]]
        starts[mine[:1]] = head.park
    return starts


def _paths(starts: Floats, goals: Floats, bends: Bends, level: Floats) -> Paths:
    """Return start, above start, bends, above goal, goal, without corners that do not move."""
    bent = np.diff(bends.offsets)
    unit = np.repeat(np.arange(len(starts)), 4 + bent)
    first = np.cumsum(4 + bent) - (4 + bent)
    last = first + 3 + bent
    corners = np.empty((len(unit), 3))
    corners[first], corners[first + 1] = starts, starts
    corners[last - 1], corners[last] = goals, goals
    on_bend = np.ones(len(unit), np.bool_)
    on_bend[[first, first + 1, last - 1, last]] = False
    corners[on_bend, :2] = bends.points
    across = (starts[:, :2] != goals[:, :2]).any(axis=1) | (bent > 0)
    lifted = across[unit]
    lifted[[first, last]] = False
    corners[lifted, 2] = level[unit[lifted]]
    keep = np.concatenate([[True], (np.diff(corners, axis=0) != 0.0).any(axis=1)])[: len(unit)]
    keep[first] = True
    counts = np.bincount(unit[keep], minlength=len(starts))
    return Paths(corners[keep], np.concatenate([[0], np.cumsum(counts)]))


def _of(bends: Bends, units: Ints) -> Bends:
    """Return the bends of some units."""
    counts = np.diff(bends.offsets)
    kept = np.repeat(np.isin(np.arange(len(counts)), units), counts)
    offsets = np.concatenate([[0], np.cumsum(counts[units])]).astype(np.int64)
    return Bends(bends.points[kept], offsets)


def _bends(order: UnitOrder, detours: Detours | None, starts: Floats, goals: Floats) -> Bends:
    """Return where travels from contour to contour bend to keep inside the part."""
    counts = np.zeros(len(order.head), np.int64)
    points = np.empty((0, 2))
    if detours is not None:
        travels = np.flatnonzero(order.kind != UNIT_PRINT)
        points, offsets = detours.bends(starts[travels], goals[travels])
        counts[travels] = np.diff(offsets)  # units are numbered as their travels are
    return Bends(points, np.concatenate([[0], np.cumsum(counts)]).astype(np.int64))


CELL_MM = 0.5


def new_height_field(
    contours: Contours, *, clearance_mm: float, cell_mm: float = CELL_MM
) -> HeightField:
    """Return an empty field that holds all these contours, for any head.

    Raises
    ------
    ValueError
        If `cell_mm` is not above 0.
    """
    if not cell_mm > 0.0:
        raise ValueError(f"cell_mm is {cell_mm}, it must be above 0")
    low, high = np.zeros(2), np.zeros(2)
    if len(contours):
        margin = clearance_mm + float(contours.width.max()) / 2 + cell_mm
        low = contours.points[:, :2].min(axis=0) - margin
        high = contours.points[:, :2].max(axis=0) + margin
    shapes = [np.maximum(np.ceil((high - low) / cell_mm).astype(np.int64), 1)]
    while shapes[-1].max() > 1:
        shapes.append(-(-shapes[-1] // FANOUT))
    sizes = [int(shape.prod()) for shape in shapes]
    return HeightField(
        np.full(sum(sizes), EMPTY),
        np.concatenate([[0], np.cumsum(sizes[:-1])]).astype(np.int64),
        np.array(shapes),
        low,
        np.array([cell_mm * FANOUT**level for level in range(len(shapes))]),
    )
