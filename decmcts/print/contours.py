"""The extrusions of a print as a struct of arrays.

A contour is a maximal continuous extrusion (Lensgraf &
Mettu 2016; Yoo et al. 2020). Contours are numbered in the order of the source,
and that order is never changed here: orders live in `decmcts.print.toolpath`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.print.brief import brief


class Role(IntEnum):
    """What a contour is for, one vocabulary for all slicers."""

    UNKNOWN = 0
    EXTERNAL_PERIMETER = 1
    PERIMETER = 2
    OVERHANG_PERIMETER = 3
    INFILL = 4
    SOLID_INFILL = 5
    TOP_SOLID_INFILL = 6
    BRIDGE_INFILL = 7
    GAP_FILL = 8
    IRONING = 9
    SKIRT_BRIM = 10
    SUPPORT = 11
    SUPPORT_INTERFACE = 12
    WIPE_TOWER = 13
    CUSTOM = 14


PER_CONTOUR = ("width", "height", "role", "closed", "layer", "tool", "reversible", "epoch", "line")
"""Fields of `Contours` with one value for each."""


@dataclass(frozen=True, slots=True)
class Contours:
    """All contours of one print, in source order.

    A bead printed with the nozzle at (x, y, z) fills from z - height to z.
    """

    points: Floats  # (n_points, 3) nozzle tip, mm
    offsets: Ints  # (n + 1,) contour i owns points[offsets[i]:offsets[i + 1]]
    extrusion: NDArray[
        np.float64
    ]  # (n_points,) filament mm of the segment ending here; 0 at a start
    feed: Floats  # (n_points,) mm/s of the segment ending here; 0 at a start
    width: Floats  # (n,) bead width, mm
    height: Floats  # (n,) bead (layer) height, mm
    role: NDArray[np.int8]  # (n,) Role
    closed: Flags  # (n,) ends where it starts (within a bead width)
    layer: Int32s  # (n,) layer index of the source, from 0
    tool: NDArray[np.int16]  # (n,) tool number of the source
    reversible: Flags  # (n,) may be reversed
    epoch: Int32s  # (n,) non-decreasing; all of epoch k before any of epoch k + 1
    line: Int32s  # (n,) source line of the first extruding move, from 1 (0: none)
    of: Int32s | None = None  # (n,) of a cut print (`decmcts.print.cut`): the source's
    # contour that each is a piece of; None: nothing is cut
    along: Floats | None = None  # (n_points,) place of each point on that contour:
    # k + f lies on the segment from its vertex k to k + 1, at the share f

    __repr__ = brief("layer", "points")

    def __post_init__(self) -> None:
        n = len(self.offsets) - 1
        for name in PER_CONTOUR:
            if getattr(self, name).shape != (n,):
                raise ValueError(f"{name} has shape {getattr(self, name).shape}, expected ({n},)")
        if self.points.shape != (int(self.offsets[-1]), 3):
            raise ValueError(
                f"points has shape {self.points.shape}, offsets end at {self.offsets[-1]}"
            )
        if n and int(np.diff(self.offsets).min()) < 2:
            raise ValueError("a contour needs at least two points")
        for name in self.__slots__:
            if getattr(self, name) is not None:
                getattr(self, name).setflags(write=False)

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @property
    def sources(self) -> Int32s:
        """Number of the source's contour that each is or is a piece of, (n,)."""
        if self.of is not None:
            return self.of
        themselves = np.arange(len(self), dtype=np.int32)
        themselves.setflags(write=False)  # as `of`: kernels are compiled for the one or the other
        return themselves

    @property
    def start(self) -> Floats:
        """First point of each contour as sliced, (n, 3)."""
        return self.points[self.offsets[:-1]]

    @property
    def end(self) -> Floats:
        """Last point of each contour as sliced, (n, 3)."""
        return self.points[self.offsets[1:] - 1]

    @property
    def top(self) -> Floats:
        """Highest z of each contour, (n,)."""
        return np.asarray(np.maximum.reduceat(self.points[:, 2], self.offsets[:-1]))

    @property
    def bottom(self) -> Floats:
        """Lowest nozzle z of each contour, (n,)."""
        return np.asarray(np.minimum.reduceat(self.points[:, 2], self.offsets[:-1]))

    def polyline(self, contour: int) -> Floats:
        """Points of one contour as sliced, (k, 3)."""
        return self.points[self.offsets[contour] : self.offsets[contour + 1]]


def taken(contours: Contours, rows: Ints) -> Contours:
    """Return these contours of a print that is not cut, in this order; `rows` has their numbers."""
    count = np.diff(contours.offsets)[rows]
    offsets = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
    point = np.repeat(contours.offsets[rows] - offsets[:-1], count) + np.arange(offsets[-1])
    return Contours(
        points=contours.points[point],
        offsets=offsets,
        extrusion=contours.extrusion[point],
        feed=contours.feed[point],
        **{name: getattr(contours, name)[rows] for name in PER_CONTOUR},
    )


def joined(first: Contours, second: Contours | None) -> Contours:
    """Return the contours of two prints, one behind the other, none of them as pieces."""
    if second is None:
        return first
    points = ("points", "extrusion", "feed", *PER_CONTOUR)
    return Contours(
        offsets=np.concatenate([first.offsets, first.offsets[-1] + second.offsets[1:]]),
        **{name: np.concatenate([getattr(first, name), getattr(second, name)]) for name in points},
    )
