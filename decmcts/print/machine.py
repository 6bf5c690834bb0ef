"""Machines: head shapes as slice stacks, bodies, rails and motion limits.

Files are read in `decmcts.formats.machine_file`; this is the frozen result.
Units mm, mm/s, mm/s².
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Slice:
    """From `height_mm` above the tip upwards the head fills `polygons`.

    Polygons are convex, counter-clockwise, in the head's own XY frame with the
    nozzle at the origin (the form PrusaSlicer uses for its real printers).
    """

    height_mm: float
    polygons: tuple[NDArray[np.float64], ...]  # each (k, 2)


@dataclass(frozen=True, slots=True)
class Body:
    """An axis-aligned box that moves with the nozzle: carriage, beam, duct."""

    name: str
    minimum: tuple[float, float, float]  # relative to the nozzle tip
    maximum: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Head:
    """One extruder: its shape near the print, its bodies, where it parks and reaches."""

    name: str
    slices: tuple[Slice, ...]  # ascending height
    bodies: tuple[Body, ...] = ()
    park: tuple[float, float, float] = (0.0, 0.0, 0.0)
    reach_min: tuple[float, float, float] = (-1e6, -1e6, -1e6)
    reach_max: tuple[float, float, float] = (1e6, 1e6, 1e6)
    tools: tuple[int, ...] = ()  # tool numbers (materials) it can print; empty: all


@dataclass(frozen=True, slots=True)
class Rail:
    """Heads that share a rail keep their order along `axis`, `separation_mm` apart.

    The reference points are the nozzles: nozzle of order[i + 1] minus nozzle of
    order[i] along the axis is at least `separation_mm` at all times.
    """

    axis: int  # 0: X, 1: Y
    order: tuple[str, ...]  # head names, ascending along the axis
    separation_mm: float


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """Limits of the time model."""

    travel_feed: float = 150.0  # mm/s, when the source names none
    z_feed: float = 20.0  # mm/s, limit of lifts
    max_feed: float = 300.0  # mm/s, XY
    acceleration: float = 1500.0  # mm/s², printing and travel
    z_acceleration: float = 300.0  # mm/s²
    jerk: float = 8.0  # mm/s, instantaneous speed change allowed at a corner


@dataclass(frozen=True, slots=True)
class Machine:
    """A printer: bed, heads and the relations between them."""

    name: str
    bed_min: tuple[float, float]
    bed_max: tuple[float, float]
    heads: tuple[Head, ...]
    clearance_mm: float = 0.0  # kept between head slices and printed beads
    bead_width: bool = True  # printed material has its beads' width; False: centrelines only
    head_clearance_mm: float = 1.0  # kept between the bodies of different heads
    lift_mm: float = 0.2  # a travel that must lift clears material by this much
    rail: Rail | None = None
    limits: MotionLimits = field(default_factory=MotionLimits)
    source: str = ""  # where the shape comes from
