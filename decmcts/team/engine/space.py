"""The space that heads reserve: who may print what, and how far apart two heads must stay.

Each body of a head, and each slice, is taken as its bounding box, and each action as
the bounding box of its nozzle's path. So a pair found clear here is clear in space, but
a pair found too near may be clear in truth. Heads on one rail are kept in order along it
(rule J3 of docs/definitions.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Flags, Floats
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob, ProcessSettings
from decmcts.print.kinematics import separations
from decmcts.print.lags_kernels import no_lags
from decmcts.print.machine import Head, Machine, MotionLimits
from decmcts.print.motion import job_times, level_travel, retraction_time, upright_travel
from decmcts.team.engine.carry_out_kernels import eligible_heads
from decmcts.team.engine.joint_kernels import Visits
from decmcts.team.engine.spaces_kernels import Fleet, Pieces


@dataclass(frozen=True, slots=True)
class Workspaces:
    """Boxes, eligibility and parking places of one print on one machine."""

    boxes: Floats  # (n, 4) min x, max x, min y, max y of each contour, mm
    parks: Floats  # (heads, 3) mm
    eligible: Flags  # (n, heads) may print it, reaches all of it and can be let in

    def __post_init__(self) -> None:
        for name in self.__slots__:
            getattr(self, name).setflags(write=False)


def contour_spaces(contours: Contours) -> Floats:
    """Return min x, max x, min y, max y, min z, max z of each contour's nozzle path, (n, 6)."""
    low = np.minimum.reduceat(contours.points, contours.offsets[:-1])
    high = np.maximum.reduceat(contours.points, contours.offsets[:-1])
    return np.stack([low, high], axis=2).reshape(-1, 6)


def eligibility(contours: Contours, heads: tuple[Head, ...]) -> Flags:
    """Return which head may print which contour: tool and reach, (n, heads)."""
    spaces, columns = contour_spaces(contours), []
    for head in heads:
        able = (spaces[:, 0::2] >= head.reach_min).all(axis=1)
        able &= (spaces[:, 1::2] <= head.reach_max).all(axis=1)
        columns.append(able & np.isin(contours.tool, head.tools) if head.tools else able)
    return np.stack(columns, axis=1)


def body_boxes(head: Head) -> Floats:
    """Return the box of every body and slice of a head, relative to its tip, (k, 6).

    A slice goes up for ever, as in the definition of what it blocks.
    """
    boxes: list[Floats] = []
    for piece in head.slices:
        for polygon in piece.polygons:
            (x0, y0), (x1, y1) = polygon.min(axis=0), polygon.max(axis=0)
            boxes.append(np.array([x0, x1, y0, y1, piece.height_mm, np.inf]))
    boxes += [np.column_stack([body.minimum, body.maximum]).reshape(-1) for body in head.bodies]
    return np.array(boxes, np.float64).reshape(-1, 6)


def relation_of(machine: Machine, r: int, s: int) -> Floats:
    """Return the boxes of nozzle of s minus nozzle of r in which two heads are too near, (k, 6)."""
    mine, other = body_boxes(machine.heads[r]), body_boxes(machine.heads[s])
    gap = machine.head_clearance_mm
    low = mine[:, None, 0::2] - other[None, :, 1::2] - gap
    high = mine[:, None, 1::2] - other[None, :, 0::2] + gap
    boxes = np.stack([low, high], axis=3).reshape(-1, 6)
    names = (machine.heads[r].name, machine.heads[s].name)
    for kept in separations(machine, *names):
        half = np.tile([-np.inf, np.inf], 3)
        half[2 * kept.axis + (1 if kept.side > 0 else 0)] = kept.side * kept.least_mm
        boxes = np.concatenate([half[None], boxes])
    return boxes[_not_within_others(boxes)]


def _not_within_others(boxes: Floats) -> Flags:
    """Return which boxes lie within no other (of equal ones the first is kept)."""
    within = (boxes[:, None, 0::2] >= boxes[None, :, 0::2]).all(axis=2)
    within &= (boxes[:, None, 1::2] <= boxes[None, :, 1::2]).all(axis=2)
    equal = within & within.T
    within &= ~equal | np.tri(len(boxes), k=-1, dtype=np.bool_)
    return np.asarray(~within.any(axis=1))


def _aside_limits(contours: Contours, machine: Machine) -> tuple[Floats, Floats]:
    """Return least and most x and y each head may step aside to, (heads, 2) each.

    That is bed and print as far as its reach goes, and the path to its park.
    """
    boxes = contour_spaces(contours)[:, :4]
    corners = [boxes[:, 0::2], boxes[:, 1::2], np.array([machine.bed_min, machine.bed_max])]
    both = np.concatenate(corners)
    parks = np.array([head.park[:2] for head in machine.heads], np.float64)
    low = np.maximum([head.reach_min[:2] for head in machine.heads], both.min(axis=0))
    high = np.minimum([head.reach_max[:2] for head in machine.heads], both.max(axis=0))
    return np.minimum(low, parks), np.maximum(high, parks)


def fleet_of(job: PrintJob, machine: Machine, live: Sequence[int] | None = None) -> Fleet:
    """Return the machine as the kernels of a joint order take it; heads not `live` never move."""
    heads = machine.heads
    pairs = [
        relation_of(machine, r, s) if r != s else np.empty((0, 6))
        for r in range(len(heads))
        for s in range(len(heads))
    ]
    parks = np.array([head.park for head in heads], np.float64)
    low, high = _aside_limits(job.contours, machine)
    still = [r for r in range(len(heads)) if live is not None and r not in live]
    low[still] = high[still] = parks[still, :2]
    top = float(job.contours.top.max(initial=0.0))
    rises = max(machine.lift_mm, *(settings.hop_mm for settings in job.settings.each()))
    # pairs that nothing but their order along a rail keeps apart: one half-space each
    halves = sum(int(np.isinf(pair[:, :4]).sum() == 3 and len(pair) == 1) for pair in pairs)
    return Fleet(
        relation=np.concatenate(pairs),
        relation_offsets=np.cumsum([0, *(len(pair) for pair in pairs)]).astype(np.int64),
        parks=parks,
        low=low,
        high=high,
        travel=np.array(
            [travel_row(job.settings, machine.limits_of(head), head.pace) for head in heads]
        ),
        ceiling=max(top, float(parks[:, 2].max())) + rises,
        rest_s=machine.rest_s,
        lined=halves == len(heads) * (len(heads) - 1),
    )


def printing_times(job: PrintJob, machine: Machine) -> Floats:
    """Return the seconds each contour takes each head, under the limits it has, (heads, n)."""
    limits = [machine.limits_of(head) for head in machine.heads]
    different = {id(one): one for one in limits}  # most machines have one for all their heads
    of_limits = {key: job_times(job, one) for key, one in different.items()}
    paces = [head.pace for head in machine.heads]
    return np.array([of_limits[id(one)] * pace for one, pace in zip(limits, paces, strict=True)])


def travel_row(settings: ProcessSettings, limits: MotionLimits, pace: float = 1.0) -> list[float]:
    """Return what a travel takes, see `decmcts.team.engine.spaces_kernels.travel_seconds`.

    By length alone: no walls are known here, and what only orders units need not be exact. Where
    all takes `pace` times as long, speeds are as many times lower.
    """
    return [
        *(v / k for v, k in zip(level_travel(settings, limits), (pace, pace**2), strict=True)),
        *(v / k for v, k in zip(upright_travel(settings, limits), (pace, pace**2), strict=True)),
        retraction_time(settings, limits) * pace,
        settings.retract_min_travel_mm,
    ]


def build_space(job: PrintJob, machine: Machine, live: Sequence[int] | None = None) -> Workspaces:
    """Return the space that heads reserve for these contours.

    A contour is eligible for a head that reaches it, has its tool and can be let in. Heads
    that are not live stay parked; the live ones may step aside for it.
    """
    eligible = eligibility(job.contours, machine.heads)
    if live is not None:
        eligible[:, [r for r in range(len(machine.heads)) if r not in live]] = False
    parks = np.array([head.park for head in machine.heads], np.float64)
    boxes = np.ascontiguousarray(contour_spaces(job.contours)[:, :4])
    return Workspaces(boxes, parks, _let_in(eligible, job, machine, live))


def able_heads(job: PrintJob, machine: Machine) -> Flags:
    """Tell of each contour which head may print it: the first found, or none, (n, heads).

    Others may be able too: asks no more heads than it must to know whether any is, which of many
    heads is far less work than `build_space`.
    """
    reached = eligibility(job.contours, machine.heads)
    able = np.zeros_like(reached)
    for r in range(len(machine.heads)):
        asked = np.zeros_like(reached)
        asked[:, r] = reached[:, r] & ~able.any(axis=1)
        if asked.any():
            able |= _let_in(asked, job, machine, None)
    return able


def whole_pieces(contours: Contours) -> Pieces:
    """Return one piece of each contour, in both directions where it may be reversed."""
    directions = np.ones((len(contours), 2), np.bool_)
    directions[:, 1] = contours.reversible
    count = int(directions.sum())
    return Pieces(
        np.concatenate([[0], np.cumsum(directions)]),
        np.repeat(contour_spaces(contours), directions.sum(axis=1), axis=0),
        np.zeros(count),
        np.zeros(count, np.int32),
    )


def _let_in(reached: Flags, job: PrintJob, machine: Machine, live: Sequence[int] | None) -> Flags:
    """Return which of the heads that reach each contour can be let in, (n, heads)."""
    contours = job.contours
    if len(machine.heads) < 2 or not len(contours):
        return reached
    ends = np.stack([contours.start, contours.end], axis=1)
    whole = whole_pieces(contours)
    none = np.zeros(len(contours) + 1, np.int64)
    visits = Visits(
        ends, np.zeros((len(machine.heads), len(contours))), contours.reversible, whole, none,
        np.empty(0, np.int32), no_lags(len(contours)),
    )  # fmt: skip
    fleet, let_in = fleet_of(job, machine, live), np.zeros_like(reached)
    for r in np.flatnonzero(reached.any(axis=0)):  # one by one: signals are heard in between
        asked = np.zeros_like(reached)
        asked[:, r] = reached[:, r]
        let_in |= eligible_heads(asked, visits, fleet)
    return let_in
