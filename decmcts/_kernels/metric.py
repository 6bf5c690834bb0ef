"""What a travel costs: length, time, or an entry of a matrix.

Kernels price a travel from port a to port b by `distance(metric, a, b)`. Port 2c
is the start of contour c and port 2c + 1 its end. The metric's type chooses the
formula when a kernel is compiled, so the common case, plain points, costs
nothing for the others.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import overload, register_jitable
from numpy.typing import NDArray


class Timed(NamedTuple):
    """Travels priced in seconds: upright and across, each from rest to rest, and what is extra."""

    points: NDArray[np.float64]  # (2n, 3) mm
    speed: float  # mm/s, level
    acceleration: float  # mm/s²
    z_speed: float  # mm/s, upright
    z_acceleration: float  # mm/s²
    hop_s: float  # for retraction, lift and their undoing, where the travel is long
    free_mm: float  # up to this length (across and upright together) a travel goes without them


class Matrix(NamedTuple):
    """Costs given pair by pair; contours have no ends of their own."""

    costs: NDArray[np.float64]  # (n, n) from row to column


Metric = NDArray[np.float64] | Timed | Matrix  # an array is (2n, 3) points, priced in mm


@register_jitable
def _length(points: Any, a: Any, b: Any) -> Any:
    dx = points[a, 0] - points[b, 0]
    dy = points[a, 1] - points[b, 1]
    dz = points[a, 2] - points[b, 2]
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@register_jitable
def _ramped(length: Any, speed: Any, acceleration: Any) -> Any:
    if length < speed * speed / acceleration:
        return 2.0 * math.sqrt(length / acceleration)
    return length / speed + speed / acceleration


@register_jitable
def _seconds(metric: Any, a: Any, b: Any) -> Any:
    points = metric.points
    dx, dy = points[a, 0] - points[b, 0], points[a, 1] - points[b, 1]
    return _paced(metric, math.sqrt(dx * dx + dy * dy), abs(points[a, 2] - points[b, 2]))


@register_jitable
def _paced(metric: Any, level: Any, rise: Any) -> Any:
    seconds = 0.0
    if level > 0.0:
        seconds += _ramped(level, metric.speed, metric.acceleration)
    if rise > 0.0:
        seconds += _ramped(rise, metric.z_speed, metric.z_acceleration)
    return seconds + metric.hop_s if level + rise > metric.free_mm else seconds


@register_jitable
def _entry(metric: Any, a: Any, b: Any) -> Any:
    return metric.costs[a >> 1, b >> 1]


def distance(metric: Metric, a: int, b: int) -> float:
    """Return what a travel from port a to port b costs, in the metric's unit."""
    if isinstance(metric, Matrix):
        return float(_entry(metric, a, b))
    if isinstance(metric, Timed):
        return float(_seconds(metric, a, b))
    return float(_length(metric, a, b))


@overload(distance, strict=False)
def _distance(metric: Any, a: Any, b: Any) -> Any:
    """Choose the formula for the metric's type."""
    if isinstance(metric, types.Array):
        return lambda metric, a, b: _length(metric, a, b)
    if getattr(metric, "instance_class", None) is Timed:
        return lambda metric, a, b: _seconds(metric, a, b)
    if getattr(metric, "instance_class", None) is Matrix:
        return lambda metric, a, b: _entry(metric, a, b)
    return None


def price(metric: Metric, level: float, rise: float) -> float:
    """Return what a travel costs that leads so far across and up or down, mm; not of a matrix.

    It grows with both.
    """
    if isinstance(metric, Timed):
        return float(_paced(metric, level, rise))
    return math.sqrt(level * level + rise * rise)


@overload(price, strict=False)
def _price(metric: Any, level: Any, rise: Any) -> Any:
    """Choose the formula for the metric's type."""
    if isinstance(metric, types.Array):
        return lambda metric, level, rise: math.sqrt(level * level + rise * rise)
    if getattr(metric, "instance_class", None) is Timed:
        return lambda metric, level, rise: _paced(metric, level, rise)
    return None


def restricted(metric: Metric, contours: NDArray[np.int32]) -> Metric:
    """Return the metric of a selection of contours, renumbered from 0."""
    if isinstance(metric, Matrix):
        return Matrix(np.ascontiguousarray(metric.costs[np.ix_(contours, contours)]))
    rows = np.stack([2 * contours, 2 * contours + 1], axis=1).ravel()
    if isinstance(metric, Timed):
        return metric._replace(points=metric.points[rows])
    return metric[rows]


def with_points(metric: Metric, points: NDArray[np.float64]) -> Metric:
    """Return the same price for other points, (2n, 3)."""
    return metric._replace(points=points) if isinstance(metric, Timed) else points


def points_of(metric: Metric) -> NDArray[np.float64]:
    """Return the metric's points, (2n, 3); empty for a matrix."""
    if isinstance(metric, Timed):
        return metric.points
    if isinstance(metric, Matrix):
        return np.empty((0, 3))
    return metric


@overload(points_of, strict=False)
def _points_of(metric: Any) -> Any:
    """Choose the access for the metric's type."""
    if isinstance(metric, types.Array):
        return lambda metric: metric
    if getattr(metric, "instance_class", None) is Timed:
        return lambda metric: metric.points
    if getattr(metric, "instance_class", None) is Matrix:
        return lambda metric: np.empty((0, 3))
    return None
