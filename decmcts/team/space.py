"""The room heads need: who may print what, and how far apart two heads must stay.

Everything is projected to XY (a head is taken to fill its outline at every
height) and each action to the bounding box of its nozzle's path, so a pair
found clear here is clear in space; the converse need not hold. Heads on one
rail are kept in order along it instead (rule J3). No times here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.print.contours import Contours
from decmcts.print.machine import Head, Machine

_NEVER = np.inf  # this side can not make two heads clear


@dataclass(frozen=True, slots=True)
class Space:
    """Boxes, gaps, eligibility and parking places of one print on one machine."""

    boxes: NDArray[np.float64]  # (n, 4) min x, max x, min y, max y of each contour, mm
    gaps: NDArray[np.float64]  # (heads, heads, 4) see decmcts._kernels.conflict
    parks: NDArray[np.float64]  # (heads, 3) mm
    eligible: NDArray[np.bool_]  # (n, heads) may print it and reaches all of it

    def __post_init__(self) -> None:
        for name in self.__slots__:
            getattr(self, name).setflags(write=False)


def head_outline(head: Head) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lowest and highest (x, y) any part of the head has, relative to its tip."""
    corners = [np.zeros((1, 2))]
    corners += [polygon for piece in head.slices for polygon in piece.polygons]
    corners += [np.array([body.minimum[:2], body.maximum[:2]]) for body in head.bodies]
    points = np.concatenate(corners)
    return points.min(axis=0), points.max(axis=0)


def contour_boxes(contours: Contours) -> NDArray[np.float64]:
    """Return min x, max x, min y, max y of each contour's nozzle path, (n, 4)."""
    n = len(contours)
    if n == 0:
        return np.empty((0, 4))
    low = np.minimum.reduceat(contours.points[:, :2], contours.offsets[:-1])
    high = np.maximum.reduceat(contours.points[:, :2], contours.offsets[:-1])
    return np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], axis=1)


def eligibility(contours: Contours, heads: tuple[Head, ...]) -> NDArray[np.bool_]:
    """Return which head may print which contour: tool and reach, (n, heads)."""
    boxes, top, bottom = contour_boxes(contours), _tops(contours), _bottoms(contours)
    columns = []
    for head in heads:
        low, high = head.reach_min, head.reach_max
        inside = (boxes[:, 0] >= low[0]) & (boxes[:, 1] <= high[0])
        inside &= (boxes[:, 2] >= low[1]) & (boxes[:, 3] <= high[1])
        inside &= (bottom >= low[2]) & (top <= high[2])
        tool = (
            np.isin(contours.tool, head.tools) if head.tools else np.ones(len(contours), np.bool_)
        )
        columns.append(inside & tool)
    return np.stack(columns, axis=1)


def _tops(contours: Contours) -> NDArray[np.float64]:
    return contours.top if len(contours) else np.empty(0)


def _bottoms(contours: Contours) -> NDArray[np.float64]:
    return contours.bottom if len(contours) else np.empty(0)


def head_gaps(machine: Machine) -> NDArray[np.float64]:
    """Return how far apart the nozzle boxes of two heads must be, (heads, heads, 4)."""
    heads = machine.heads
    gaps = np.full((len(heads), len(heads), 4), _NEVER)
    outlines = [head_outline(head) for head in heads]
    for r in range(len(heads)):
        for s in range(len(heads)):
            if r != s:
                gaps[r, s] = _pair_gap(machine, r, s, outlines[r], outlines[s])
    return gaps


def _pair_gap(
    machine: Machine,
    r: int,
    s: int,
    mine: tuple[NDArray[np.float64], NDArray[np.float64]],
    other: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Sides of `gaps[r, s]`: r below s, s below r along x, then along y."""
    below = mine[1] - other[0] + machine.head_clearance_mm
    above = other[1] - mine[0] + machine.head_clearance_mm
    bodies = np.array([below[0], above[0], below[1], above[1]])
    rail = machine.rail
    names = (machine.heads[r].name, machine.heads[s].name)
    if rail is None or not set(names) <= set(rail.order):
        return bodies
    steps = rail.order.index(names[1]) - rail.order.index(names[0])
    side = 2 * rail.axis + (0 if steps > 0 else 1)
    only = np.full(4, _NEVER)
    only[side] = max(bodies[side], rail.separation_mm * abs(steps))
    return only


def build_space(contours: Contours, machine: Machine) -> Space:
    """Return the room the heads need for these contours.

    A contour that can not be printed past another head's park is not eligible.
    """
    parks = np.array([head.park for head in machine.heads], np.float64)
    boxes, gaps = contour_boxes(contours), head_gaps(machine)
    eligible = eligibility(contours, machine.heads) & _clear_of_parks(boxes, gaps, parks)
    return Space(boxes, gaps, parks, eligible)


def _clear_of_parks(
    boxes: NDArray[np.float64], gaps: NDArray[np.float64], parks: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return where head r can work while every other head is parked, (n, heads)."""
    clear = np.ones((len(boxes), len(parks)), np.bool_)
    for r in range(len(parks)):
        for s in range(len(parks)):
            if s != r:
                gap, park = gaps[r, s], parks[s]
                side = (boxes[:, 1] + gap[0] <= park[0]) | (park[0] + gap[1] <= boxes[:, 0])
                side |= (boxes[:, 3] + gap[2] <= park[1]) | (park[1] + gap[3] <= boxes[:, 2])
                clear[:, r] &= side
    return clear


def require_printable(contours: Contours, machine: Machine, eligible: NDArray[np.bool_]) -> None:
    """Raise InputError naming the first contour that no head may print."""
    missing = np.flatnonzero(~eligible.any(axis=1))
    if not len(missing):
        return
    first = int(missing[0])
    low = contours.polyline(first).min(axis=0)
    high = contours.polyline(first).max(axis=0)
    raise InputError(
        f"no head of {machine.name} can print contour {first} (tool {contours.tool[first]}, "
        f"x {low[0]:.2f}..{high[0]:.2f}, y {low[1]:.2f}..{high[1]:.2f}, z up to {high[2]:.2f} mm), "
        f"{len(missing)} such contours in all",
        line=int(contours.line[first]) or None,
        advice="move the print into the heads' reach or choose a machine with that tool",
    )
