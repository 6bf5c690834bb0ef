"""Programs of simulated controllers made by hand."""

from __future__ import annotations

import numpy as np

from decmcts.print.machine import Body, Head, Machine, MotionLimits, Rail
from sim.controllers.program import HeadProgram, stops_of

LIMITS = MotionLimits(
    max_feed=(200.0, 200.0, 20.0, 50.0), max_acceleration=(1000.0, 1000.0, 100.0, 5000.0),
    jerk=(10.0, 10.0, 1.0, 5.0), acceleration=1000.0, travel_acceleration=1000.0,
)  # fmt: skip


def program(points, *, feed=100.0, stops=(), name="left", limits=LIMITS, rest=()) -> HeadProgram:
    """A program of moves without filament; `stops` are (before, kind, number, value)."""
    points = np.asarray(points, float)
    m = len(points) - 1
    rests = np.isin(np.arange(m), rest)
    return HeadProgram(
        name, points, np.zeros(m), np.full(m, feed), np.zeros(m, np.int64), (limits,), rests,
        np.cumsum(rests), np.zeros(m, np.int64), stops_of(list(stops)),
    )  # fmt: skip


def cube(name: str, x: float) -> Head:
    return Head(name, (), (Body("body", (-10.0, -10.0, 0.0), (10.0, 10.0, 30.0)),), (x, 0.0, 0.0))


def pair(separation: float | None = None, rest_s: float = 0.0) -> Machine:
    """Two heads, cubes of 20 mm; on a rail if they have a separation."""
    rails = () if separation is None else (Rail(0, ("left", "right"), separation),)
    return Machine(
        "pair", (0.0, 0.0), (200.0, 200.0), (cube("left", 0.0), cube("right", 200.0)),
        head_clearance_mm=1.0, rails=rails, limits=LIMITS, rest_s=rest_s,
    )  # fmt: skip
