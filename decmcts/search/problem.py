"""The problem a planner for one head solves, without anything it does not need.

A planner knows endpoints, which contours may turn, layers and the dependency
graph. How contours look in between, or how the source text looked, stays
outside, so that a bare problem (endpoints and precedence) can be solved too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.metric import Matrix, Metric, Timed, distance
from decmcts._kernels.tour import longest_hop
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.job import PrintJob

Freedom = Literal["fixed", "reversible"]


@dataclass(frozen=True, slots=True)
class Pace:
    """How fast travels go, for searches that minimise time."""

    speed: float  # mm/s, level
    acceleration: float  # mm/s², from rest and to rest
    z_speed: float  # mm/s, upright; travels go up or down and across one after the other
    z_acceleration: float  # mm/s²
    hop_s: float = 0.0  # retraction, lift and their undoing
    free_mm: float = 0.0  # travels up to this length go without them

    def __post_init__(self) -> None:
        rates = (self.speed, self.acceleration, self.z_speed, self.z_acceleration)
        if not min(rates) > 0.0:
            raise ValueError(f"speeds and accelerations {rates}: expected above 0")
        if not (self.hop_s >= 0.0 and self.free_mm >= 0.0):
            raise ValueError(f"hop {self.hop_s} s, free {self.free_mm} mm: expected 0 or more")


@dataclass(frozen=True, slots=True)
class OrderProblem:
    """Order `n` contours, and choose the direction of those that may turn.

    Contours are numbered in source order, which is a linear extension of
    `graph`: the source is always a solution.
    """

    start: NDArray[np.float64]  # (n, 3) first point as sliced, mm
    end: NDArray[np.float64]  # (n, 3) last point as sliced, mm
    reversible: NDArray[np.bool_]  # (n,) may be printed backwards
    layer: NDArray[np.int32]  # (n,) layer index of the source
    graph: DependencyGraph
    pace: Pace | None = None  # travels cost seconds instead of mm
    costs: NDArray[np.float64] | None = None  # (n, n) bare costs instead of both

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
                raise ValueError("bare costs need an (n, n) matrix and contours that never turn")
            if np.isnan(self.costs).any():
                raise ValueError("a cost is not a number")

    def __len__(self) -> int:
        return self.graph.n

    @staticmethod
    def from_job(job: PrintJob, graph: DependencyGraph, freedom: Freedom) -> OrderProblem:
        """Take the endpoints and freedoms of a job.

        Parameters
        ----------
        freedom : {"fixed", "reversible"}
            With "fixed" nothing turns. With "reversible" the open contours that
            the reader marked reversible may; turning a closed contour changes
            no travel, so closed contours keep the slicer's direction.

        Raises
        ------
        ValueError
            If `freedom` is unknown or the graph is of another print.
        """
        contours = job.contours
        if freedom not in ("fixed", "reversible"):
            raise ValueError(f"freedom is {freedom!r}, expected 'fixed' or 'reversible'")
        if graph.n != len(contours):
            raise ValueError(f"the graph has {graph.n} contours, the job {len(contours)}")
        turns = contours.reversible & ~contours.closed & (freedom == "reversible")
        return OrderProblem(
            np.ascontiguousarray(contours.start, np.float64),
            np.ascontiguousarray(contours.end, np.float64),
            np.ascontiguousarray(turns, np.bool_),
            np.ascontiguousarray(contours.layer, np.int32),
            graph,
        )

    @property
    def unit(self) -> str:
        """Unit of costs: "mm", "s", or "" for bare costs."""
        return "" if self.costs is not None else "mm" if self.pace is None else "s"

    def metric(self) -> Metric:
        """Return what prices travels, made anew: its points may be changed."""
        if self.costs is not None:
            return Matrix(np.ascontiguousarray(self.costs, np.float64))
        if self.pace is None:
            return self.ports()
        return _timed(self.ports(), self.pace)

    def longest_hop(self) -> float:
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
        return float(distance(_timed(ends, self.pace), 0, 1))

    def ports(self) -> NDArray[np.float64]:
        """Return the endpoints as (2n, 3): port 2c is the start of contour c, 2c + 1 its end."""
        return np.ascontiguousarray(np.stack([self.start, self.end], axis=1).reshape(-1, 3))


def _timed(points: NDArray[np.float64], pace: Pace) -> Timed:
    return Timed(
        points, pace.speed, pace.acceleration, pace.z_speed, pace.z_acceleration, pace.hop_s,
        pace.free_mm,
    )  # fmt: skip
