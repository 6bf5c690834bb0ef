"""The problem a planner for one head solves, without anything it does not need.

A planner knows endpoints, which contours may be reversed, layers and the dependency
graph. How contours look in between, or how the source text looked, stays
outside, so that a bare problem (endpoints and precedence) can be solved too.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.seam import SeamPolicy, entry_points, exit_points, seam_entries
from decmcts.print.walls import has_walls, no_walls
from decmcts.print.walls_kernels import Walls
from decmcts.search.sequence.entries_kernels import choose_visits
from decmcts.search.sequence.metric_kernels import (
    NO_WALLS,
    Matrix,
    Metric,
    Timed,
    costliest,
    distance,
    longest_hop,
)
from decmcts.search.sequence.timed_lags import TimedLags

FreedomWord = Literal["fixed", "reversible", "seam"]


_NO_RAMP = 1e15  # mm/s²: a travel of 1 mm/s takes what it is long, to 1e-15 s
MOST_ANCHORS = 6  # entries of one contour that have near lists of their own


@dataclass(frozen=True, slots=True)
class Pace:
    """How fast travels go, for searches that minimise time."""

    speed: float  # mm/s, level
    acceleration: float  # mm/s², from rest and to rest
    z_speed: float  # mm/s, upright; travels go up or down and across one after the other
    z_acceleration: float  # mm/s²
    hop_s: float = 0.0  # retraction, lift and their undoing
    free_mm: float = 0.0  # travels up to this length go without them
    bare_mm: float = 0.0  # and those inside the walls up to this
    climb_mm: float = 0.0  # which may climb so far
    over: float = 0.0  # travels that cross outer walls take so many times their time more
    walls: Walls = field(default_factory=no_walls, compare=False)  # outer ones of the part
    unit: str = "s"  # "mm" where speeds are 1 and nothing ramps

    @staticmethod
    def in_mm(walls: Walls, over: float) -> Pace:
        """Return what prices travels by their length, mm, and more so where they cross walls."""
        return Pace(1.0, _NO_RAMP, 1.0, _NO_RAMP, over=over, walls=walls, unit="mm")

    @property
    def looks_at_walls(self) -> bool:
        """Whether what a travel costs depends on walls; it takes longer to price then."""
        bare = self.hop_s > 0.0 and self.bare_mm > self.free_mm
        return (bare or self.over > 0.0) and has_walls(self.walls)


@dataclass(frozen=True)
class Seams:
    """Where contours may be entered: the entries of each, those of contour c in a row.

    A contour with one entry has no choice: its start and end are that entry's.
    """

    offsets: Ints  # (n + 1,) contour c owns entries offsets[c]:offsets[c + 1], >= 1
    enter: Floats  # (m, 3)
    leave: Floats  # (m, 3)
    vertices: Int32s  # (m,) numbers of points within the contour

    @cached_property
    def owner(self) -> Int32s:
        """Contour of each entry, (m,)."""
        return np.repeat(np.arange(len(self.offsets) - 1, dtype=np.int32), np.diff(self.offsets))

    @property
    def sliced(self) -> Int32s:
        """First entry of contours with a choice, the slicer's own if allowed; else -1, (n,)."""
        first = self.offsets[:-1].astype(np.int32)
        return np.where(np.diff(self.offsets) > 1, first, -1).astype(np.int32)

    @cached_property
    def row_offsets(self) -> Ints:
        """Contour c has anchors row_offsets[c]:row_offsets[c + 1], or none, (n + 1,)."""
        counts = np.diff(self.offsets)
        kept = np.where(counts > 1, np.minimum(counts, MOST_ANCHORS), 0)
        return np.concatenate([[0], np.cumsum(kept)]).astype(np.int64)

    @cached_property
    def anchors(self) -> Ints:
        """Entry in the middle of each run that shares a row of the near lists."""
        chosen = np.flatnonzero(np.diff(self.offsets)[self.owner] > 1)
        begins = np.flatnonzero(np.diff(self.rows[chosen], prepend=-1))
        ends = np.append(begins[1:], len(chosen))
        return np.asarray(chosen[(begins + ends - 1) // 2])

    @cached_property
    def rows(self) -> Int32s:
        """Row of the near lists for each entry; of no meaning without choice, (m,)."""
        counts, owner = np.diff(self.offsets)[self.owner], self.owner
        place = np.arange(len(owner)) - self.offsets[owner]
        kept = np.diff(self.row_offsets)[owner]
        first = 2 * (len(self.offsets) - 1) + self.row_offsets[owner]
        return np.asarray(first + place * kept // counts, np.int32)


@dataclass(frozen=True, slots=True)
class OrderProblem:
    """Order `n` contours, and choose the direction of those that may be reversed.

    Contours are numbered in source order, which is a linear extension of
    `graph`: the source is always a solution.
    """

    start: Floats  # (n, 3) first point as sliced, mm
    end: Floats  # (n, 3) last point as sliced, mm
    reversible: Flags  # (n,) may be reversed
    layer: Int32s  # (n,) layer index of the source
    graph: DependencyGraph
    pace: Pace | None = None  # travels cost seconds instead of mm
    costs: Floats | None = None  # (n, n) bare costs instead of both
    seams: Seams | None = None  # where loops may be entered; None: as sliced
    timed_lags: TimedLags | None = None  # time between contours that lie on each other; None: any

    def __post_init__(self) -> None:
        n = self.graph.n
        shapes = {"start": (n, 3), "end": (n, 3), "reversible": (n,), "layer": (n,)}
        for name, shape in shapes.items():
            array = getattr(self, name)
            if array.shape != shape:
                raise ValueError(f"{name} has shape {array.shape}, expected {shape}")
            array.setflags(write=False)
        if not (np.isfinite(self.start).all() and np.isfinite(self.end).all()):
            raise ValueError("an endpoint is not finite")
        if self.costs is not None:
            if self.costs.shape != (n, n) or self.reversible.any():
                raise ValueError(
                    "bare costs need an (n, n) matrix and contours that are never reversed"
                )
            if np.isnan(self.costs).any():
                raise ValueError("a cost is not a number")
        if self.timed_lags is not None and len(self.timed_lags.seconds) != n:
            raise ValueError(f"times of {len(self.timed_lags.seconds)} contours, expected {n}")

    def __len__(self) -> int:
        return self.graph.n

    @staticmethod
    def from_job(
        job: PrintJob,
        graph: DependencyGraph,
        freedom: FreedomWord,
        seam: SeamPolicy = "nearest",
    ) -> OrderProblem:
        """Take the endpoints and freedoms of a job.

        Parameters
        ----------
        freedom : {"fixed", "reversible", "seam"}
            With "fixed" nothing is reversed. With "reversible" the open contours that
            the reader marked reversible may be; reversing a closed contour changes
            no travel, so closed contours keep the slicer's direction. With "seam"
            closed contours may also be entered elsewhere.
        seam : SeamPolicy
            Where, with freedom "seam".

        Raises
        ------
        ValueError
            If `freedom` is unknown or the graph is of another print.
        """
        contours = job.contours
        if freedom not in get_args(FreedomWord):
            raise ValueError(f"freedom is {freedom!r}, expected one of {get_args(FreedomWord)}")
        if graph.n != len(contours):
            raise ValueError(f"the graph has {graph.n} contours, the job {len(contours)}")
        reversible = contours.reversible & ~contours.closed & (freedom != "fixed")
        start, end, seams = contours.start, contours.end, None
        if freedom == "seam":
            seams = _seams(contours, seam)
            reversible &= np.diff(seams.offsets) == 1
            first = seams.offsets[:-1]
            start, end = seams.enter[first], seams.leave[first]
        return OrderProblem(
            np.ascontiguousarray(start, np.float64),
            np.ascontiguousarray(end, np.float64),
            np.ascontiguousarray(reversible, np.bool_),
            np.ascontiguousarray(contours.layer, np.int32),
            graph,
            seams=seams,
        )

    @staticmethod
    def of_costs(costs: Floats, graph: DependencyGraph) -> OrderProblem:
        """Take bare costs, (n, n): nodes that lie nowhere and are never reversed."""
        n = graph.n
        nowhere, layer = np.zeros((n, 3)), np.zeros(n, np.int32)
        return OrderProblem(nowhere, nowhere, np.zeros(n, np.bool_), layer, graph, costs=costs)

    @property
    def unit(self) -> str:
        """Unit of costs: "mm", "s", or "" for bare costs."""
        return "" if self.costs is not None else "mm" if self.pace is None else self.pace.unit

    def metric(self) -> Metric:
        """Return what prices travels, made anew: its points may be changed."""
        if self.costs is not None:
            return Matrix(np.ascontiguousarray(self.costs, np.float64))
        points = self.ports()
        if self.seams is not None:
            entries = np.stack([self.seams.enter, self.seams.leave], axis=1).reshape(-1, 3)
            points = np.concatenate([points, entries])
        return points if self.pace is None else _timed(points, self.pace)

    def visits_for(self, metric: Metric, order: Int32s) -> tuple[NDArray[np.uint8], Int32s]:
        """Return the directions and entries, by contour, that suit an order best.

        `metric` is the problem's own, whatever its ports have been changed to.
        """
        offsets = np.zeros(len(self) + 1, np.int64) if self.seams is None else self.seams.offsets
        is_reversed, entry_id = choose_visits(metric, order, self.reversible, offsets)
        return is_reversed, entry_id

    def longest_travel(self) -> float:
        """Return the cost of the longest travel there can be."""
        if self.costs is not None:
            return float(self.costs.max(initial=0.0))
        ports = self.ports()
        if self.pace is None:
            return float(longest_hop(ports, self.reversible))
        rise = float(np.ptp(ports[:, 2])) if len(ports) else 0.0
        ports[:, 2] = 0.0
        level = float(longest_hop(ports, self.reversible))
        ends = np.array([[0.0, 0.0, 0.0], [level, 0.0, rise]])
        return float(distance(costliest(_timed(ends, self.pace), ends), 0, 1))

    def ports(self) -> Floats:
        """Return the endpoints as (2n, 3): port 2c is the start of contour c, 2c + 1 its end."""
        return np.ascontiguousarray(np.stack([self.start, self.end], axis=1).reshape(-1, 3))


def _seams(contours: Contours, policy: SeamPolicy) -> Seams:
    entries = seam_entries(contours, policy)
    return Seams(
        entries.offsets,
        entry_points(contours, entries),
        exit_points(contours, entries),
        entries.vertices,
    )


def _timed(points: Floats, pace: Pace) -> Timed:
    looks = pace.looks_at_walls
    return Timed(
        points, pace.speed, pace.acceleration, pace.z_speed, pace.z_acceleration, pace.hop_s,
        pace.free_mm, pace.bare_mm if looks else NO_WALLS, pace.climb_mm,
        pace.over if looks else 0.0, pace.walls,
    )  # fmt: skip
