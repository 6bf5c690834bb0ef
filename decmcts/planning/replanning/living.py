"""The machine of the heads that live: those that failed are obstacles where they may stand.

A head's reach is lessened to one side of the obstacle, so that it never comes near, whatever it
does. That is more careful than it has to be where heads could pass.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.print.contours import Contours
from decmcts.print.kinematics import separations
from decmcts.print.machine import Head, Machine, Stands, line_of

Box = tuple[NDArray[np.float64], NDArray[np.float64]]  # lower and upper corner, mm
ALL_FENCED = (
    "name fewer with --fenced; if by the events all of them failed, say what is printed"
    " by --layer N or --height Z in place of --events"
)
BESIDE_MM = 0.01  # more than it must be: files round


def living_machine(machine: Machine, fenced: Mapping[str, Stands], rest: Contours) -> Machine:
    """Return the machine without heads that are `fenced` where they stand.

    Each head keeps the side from which it reaches the most of the `rest`.

    Raises
    ------
    InputError
        When no head lives, or one parks where it could touch one that is fenced.
    """
    heads = [head for head in machine.heads if head.name not in fenced]
    if not heads:
        raise InputError("every head is fenced, so none is left to print with", advice=ALL_FENCED)
    known = {head.name: head for head in machine.heads}
    for name, stands in fenced.items():
        line = line_of(stands)
        there = line.min(axis=0), line.max(axis=0)
        heads = [_beside(machine, head, known[name], there, rest) for head in heads]
    return machine.of_heads(heads)


def slowed(machine: Machine, slower: Mapping[str, float]) -> Machine:
    """Return the machine with heads that take so many times as long as they did."""
    heads = [replace(head, pace=head.pace * slower.get(head.name, 1.0)) for head in machine.heads]
    return replace(machine, heads=tuple(heads))


def _beside(machine: Machine, head: Head, gone: Head, there: Box, rest: Contours) -> Head:
    """Return a head whose reach keeps clear of one that stands anywhere in a box."""
    for kept in separations(machine, gone.name, head.name):
        nearest = float(there[kept.side > 0][kept.axis])
        limit = nearest + kept.side * kept.least_mm
        head = _cut(head, gone, kept.axis, limit, upwards=kept.side > 0)
    low, high = _forbidden(machine, head, gone, there)
    sides = [(axis, float(low[axis]), False) for axis in (0, 1)]
    sides += [(axis, float(high[axis]), True) for axis in (0, 1)]
    if any(_keeps(head, *side) for side in sides):
        return head
    free = [side for side in sides if _parks(head, *side)]
    if not free:
        raise _in_the_way(head, gone)
    cut = [_cut(head, gone, axis, limit, upwards=upwards) for axis, limit, upwards in free]
    return max(cut, key=lambda one: _reached(one, rest))


def _forbidden(machine: Machine, head: Head, gone: Head, there: Box) -> Box:
    """Return where the nozzle of a head might touch one that stands there, seen from above."""
    (low, high), (its_low, its_high) = _outline(head), _outline(gone)
    margin = max(machine.head_clearance_mm, machine.clearance_mm) + BESIDE_MM
    return there[0][:2] + its_low - high - margin, there[1][:2] + its_high - low + margin


def _outline(head: Head) -> Box:
    """Return the box around all of a head, seen from above, with its nozzle at the origin."""
    corners = [np.zeros((1, 2))]
    corners += [np.asarray(polygon) for one in head.slices for polygon in one.polygons]
    corners += [np.array([body.minimum[:2], body.maximum[:2]]) for body in head.bodies]
    every = np.concatenate(corners)
    return every.min(axis=0), every.max(axis=0)


def _keeps(head: Head, axis: int, limit: float, upwards: bool) -> bool:
    """Tell whether all of a head's reach, and its park, lie on this side."""
    ends = (head.reach_min if upwards else head.reach_max)[axis], head.park[axis]
    return min(ends) >= limit if upwards else max(ends) <= limit


def _parks(head: Head, axis: int, limit: float, upwards: bool) -> bool:
    return head.park[axis] >= limit if upwards else head.park[axis] <= limit


def _cut(head: Head, gone: Head, axis: int, limit: float, *, upwards: bool) -> Head:
    """Return a head whose reach ends at `limit`; raises InputError if it parks beyond."""
    if not _parks(head, axis, limit, upwards):
        raise _in_the_way(head, gone)
    low, high = list(head.reach_min), list(head.reach_max)
    if upwards:
        low[axis] = max(low[axis], limit)
        high[axis] = max(high[axis], limit)  # one that reaches nothing there stays where it parks
    else:
        high[axis] = min(high[axis], limit)
        low[axis] = min(low[axis], limit)
    return replace(
        head, reach_min=(low[0], low[1], low[2]), reach_max=(high[0], high[1], high[2])
    )  # fmt: skip


def _reached(head: Head, rest: Contours) -> int:
    """Return how many points of the rest lie within a head's reach."""
    inside = (rest.points >= head.reach_min) & (rest.points <= head.reach_max)
    return int(inside.all(axis=1).sum())


def _in_the_way(head: Head, gone: Head) -> InputError:
    return InputError(
        f"head {head.name} parks where it could touch head {gone.name}, which is fenced",
        advice=f"move {gone.name} away and name where it stands: --fenced {gone.name}=park or "
        f"{gone.name}=X,Y,Z",
    )
