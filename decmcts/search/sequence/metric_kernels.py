"""What a travel costs: length, time, or an entry of a matrix.

Kernels price a travel from port a to port b by `distance(metric, a, b)`. Port 2c
is the start of contour c and port 2c + 1 its end. The metric's type chooses the
formula when a kernel is compiled, so the common case, plain points, costs
nothing for the others. Whether a travel is bare takes a walk through walls: only
travels that are neither short nor too long have it.

Also here: whether a sequence keeps precedence, and the longest travel there can be.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import overload, register_jitable

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.compiled import apart, kernel
from decmcts.print.walls_kernels import SAME_Z_MM, Walls, bare, layer_at, over_either

NO_WALLS = -1.0  # for `Timed.bare_mm` where prices depend on no walls


@kernel
def respects(order: Int32s, succ_offsets: Ints, succs: Int32s) -> bool:
    """Say whether `order` is a permutation that breaks no edge."""
    n = len(succ_offsets) - 1
    position = np.full(n, -1, np.int64)
    for k in range(len(order)):
        if order[k] < 0 or order[k] >= n or position[order[k]] >= 0:
            return False
        position[order[k]] = k
    if len(order) != n:
        return False
    for a in range(n):
        for e in range(succ_offsets[a], succ_offsets[a + 1]):
            if position[succs[e]] < position[a]:
                return False
    return True


@kernel
def longest_hop(points: Floats, reversible: Flags) -> float:
    """Return the longest travel from an exit of one contour to an entry of another, mm.

    Pairs are tried from the farthest from the centre inwards and cut off by the
    triangle inequality: near linear on real prints, O(n²) at worst.
    """
    n = len(reversible)
    centre = np.array([points[:, 0].mean(), points[:, 1].mean(), points[:, 2].mean()])
    radius = np.sqrt(((points - centre) ** 2).sum(axis=1))
    outward = np.argsort(-radius)
    longest = 0.0
    for x in range(2 * n):
        a = outward[x]
        if a % 2 == 0 and not reversible[a // 2]:
            continue
        for y in range(2 * n):
            b = outward[y]
            if radius[a] + radius[b] <= longest:
                break
            if a // 2 != b // 2 and (b % 2 == 0 or reversible[b // 2]):
                longest = max(longest, distance(points, a, b))
    return longest


class Timed(NamedTuple):
    """Travels priced in seconds: upright and across, each from rest to rest, and what is extra.

    Those that the source leaves bare inside the part go without a hop, and those that cross
    outer walls are dearer. With a speed of 1 and no ramps the price is in mm.
    """

    points: Floats  # (2n + 2m, 3) mm: the ends of n contours, then of m entries
    speed: float  # mm/s, level
    acceleration: float  # mm/s²
    z_speed: float  # mm/s, upright
    z_acceleration: float  # mm/s²
    hop_s: float  # for retraction, lift and their undoing, where the travel is long
    free_mm: float  # up to this length (across and upright together) a travel goes without them
    bare_mm: float  # up to this length, level, so do travels inside the part; NO_WALLS: none does
    climb_mm: float  # and may climb so far to the next layer
    over: float  # travels that cross walls take so many times their time more
    walls: Walls  # of the part


class Matrix(NamedTuple):
    """Costs given pair by pair; contours have no ends of their own."""

    costs: Floats  # (n, n) from row to column


Metric = Floats | Timed | Matrix
# an array is (2n + 2m, 3) points, priced in mm


def _by_type(metric: Any, array: Any, timed: Any, matrix: Any = None) -> Any:
    """Return the formula for a metric of a type that numba knows; None: there is none."""
    if isinstance(metric, types.Array):
        return array
    kind: Any = getattr(metric, "instance_class", None)
    return {Timed: timed, Matrix: matrix}.get(kind)


@register_jitable
def _length(metric: Any, a: Any, b: Any) -> Any:
    dx = metric[a, 0] - metric[b, 0]
    dy = metric[a, 1] - metric[b, 1]
    dz = metric[a, 2] - metric[b, 2]
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@register_jitable
def _ramped(length: Any, speed: Any, acceleration: Any) -> Any:
    if length < speed * speed / acceleration:
        return 2.0 * math.sqrt(length / acceleration)
    return length / speed + speed / acceleration


@register_jitable
def _moving(metric: Any, level: Any, rise: Any) -> Any:
    seconds = 0.0
    if level > 0.0:
        seconds += _ramped(level, metric.speed, metric.acceleration)
    if rise > 0.0:
        seconds += _ramped(rise, metric.z_speed, metric.z_acceleration)
    return seconds


@register_jitable
def _seconds(metric: Any, a: Any, b: Any) -> Any:
    points = metric.points
    dx, dy = points[a, 0] - points[b, 0], points[a, 1] - points[b, 1]
    level, rise = math.sqrt(dx * dx + dy * dy), abs(points[a, 2] - points[b, 2])
    seconds = _moving(metric, level, rise)
    if metric.bare_mm != NO_WALLS:
        return seconds + _by_walls(metric, a, b, level, rise)
    return seconds + metric.hop_s if level + rise > metric.free_mm else seconds


@apart
def _by_walls(metric: Timed, a: int, b: int, level: float, rise: float) -> float:
    """Return what a travel takes beside moving, with a look at the walls."""
    points, walls = metric.points, metric.walls
    ax, ay, az = points[a, 0], points[a, 1], points[a, 2]
    bx, by, bz = points[b, 0], points[b, 1], points[b, 2]
    is_long = level + rise > metric.free_mm
    if metric.over > 0.0 and over_either(
        walls, layer_at(walls, az), layer_at(walls, bz), ax, ay, bx, by
    ):
        more: float = metric.over * _moving(metric, level, 0.0)
        return more + metric.hop_s if is_long else more
    if not is_long or (
        level <= metric.bare_mm
        and bare(walls, metric.bare_mm, metric.climb_mm, ax, ay, az, bx, by, bz)
    ):
        return 0.0
    return metric.hop_s


@register_jitable
def _least(metric: Any, level: Any, rise: Any) -> Any:
    seconds = _moving(metric, level, rise)
    if level <= metric.bare_mm and rise <= metric.climb_mm + SAME_Z_MM:
        return seconds
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
    return _by_type(metric, _length, _seconds, _entry)


def price(metric: Metric, level: float, rise: float) -> float:
    """Return what a travel costs at least that leads so far across and up or down, mm.

    Not of a matrix. It grows with both. A travel that may be bare is taken to be.
    """
    if isinstance(metric, Timed):
        return float(_least(metric, level, rise))
    return math.sqrt(level * level + rise * rise)


@overload(price, strict=False)
def _price(metric: Any, level: Any, rise: Any) -> Any:
    return _by_type(
        metric, lambda metric, level, rise: math.sqrt(level * level + rise * rise), _least
    )


def costs_the_same_back(metric: Metric, a: int, b: int) -> bool:
    """Tell whether a travel from port a to port b surely costs what that from b to a does.

    A travel that climbs may be bare, one down never is. Not of a matrix.
    """
    return not isinstance(metric, Timed) or bool(_same_back(metric, a, b))


@register_jitable
def _same_back(metric: Any, a: Any, b: Any) -> Any:
    if metric.bare_mm == NO_WALLS:
        return True
    return abs(metric.points[a, 2] - metric.points[b, 2]) <= SAME_Z_MM


@overload(costs_the_same_back, strict=False)
def _costs_the_same_back(metric: Any, a: Any, b: Any) -> Any:
    """Choose by the metric's type: there is nothing to look at but where travels may be bare."""
    if getattr(metric, "instance_class", None) is Timed:
        return _same_back
    return lambda metric, a, b: True


def with_points(metric: Metric, points: Floats) -> Metric:
    """Return the same price for other points, (2n + 2m, 3)."""
    return metric._replace(points=points) if isinstance(metric, Timed) else points


def costliest(metric: Metric, points: Floats) -> Metric:
    """Return the price for other points, (2n + 2m, 3), as if all travels crossed walls."""
    if isinstance(metric, Timed):
        longer = 1.0 + metric.over
        return metric._replace(
            points=points, speed=metric.speed / longer, over=0.0, bare_mm=NO_WALLS,
            acceleration=metric.acceleration / longer**2,
        )  # fmt: skip
    return with_points(metric, points)


def points_of(metric: Metric) -> Floats:
    """Return the metric's points, (2n + 2m, 3). Not of a matrix."""
    if isinstance(metric, Timed):
        return metric.points
    assert not isinstance(metric, Matrix)
    return metric


@overload(points_of, strict=False)
def _points_of(metric: Any) -> Any:
    return _by_type(metric, lambda metric: metric, lambda metric: metric.points)
