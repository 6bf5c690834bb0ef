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

from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.job import PrintJob

Freedom = Literal["fixed", "reversible"]


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

    def ports(self) -> NDArray[np.float64]:
        """Return the endpoints as (2n, 3): port 2c is the start of contour c, 2c + 1 its end."""
        return np.ascontiguousarray(np.stack([self.start, self.end], axis=1).reshape(-1, 3))
