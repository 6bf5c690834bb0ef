"""Trapezoidal motion with look-ahead on bare arrays.

A polyline is travelled from rest to rest. Each segment has a speed and an
acceleration limit; at a corner the speed is limited so that no more than the
jerk is changed at once. Two passes propagate what braking and speeding up
allow, as every firmware planner does. Validation is the callers'.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel


@kernel
def trapezoid_time(
    length: float, start: float, end: float, top: float, acceleration: float
) -> float:
    """Time of one straight move from speed `start` to `end`, at most `top`."""
    peak: float = np.sqrt(acceleration * length + 0.5 * (start * start + end * end))
    peak = max(peak, max(start, end))
    if peak <= top:
        return (2.0 * peak - start - end) / acceleration
    ramps = (2.0 * top * top - start * start - end * end) / (2.0 * acceleration)
    return (2.0 * top - start - end) / acceleration + (length - ramps) / top


@kernel
def segment_limits(
    dx: float,
    dy: float,
    dz: float,
    feed: float,
    max_feed: float,
    z_feed: float,
    acceleration: float,
    z_acceleration: float,
) -> tuple[float, float, float]:
    """Length, speed limit and acceleration of one segment."""
    length = np.sqrt(dx * dx + dy * dy + dz * dz)
    if length <= 0.0:
        return 0.0, feed, acceleration
    flat = np.sqrt(dx * dx + dy * dy) / length
    steep = abs(dz) / length
    if flat * feed > max_feed:
        feed = max_feed / flat
    if steep * feed > z_feed:
        feed = z_feed / steep
    if flat * acceleration > 0.0 and steep * acceleration > z_acceleration:
        acceleration = z_acceleration / steep
    elif flat == 0.0:
        acceleration = z_acceleration
    return length, feed, acceleration


@kernel
def polyline_time(
    points: NDArray[np.float64],
    feeds: NDArray[np.float64],
    limits: NDArray[np.float64],
    scratch: NDArray[np.float64],
) -> float:
    """Time of one polyline (k, 3) from rest to rest; `feeds[i]` of the segment ending at i.

    `limits` = (max_feed, z_feed, acceleration, z_acceleration, jerk).
    `scratch` (≥ k, 4) is overwritten: length, speed, acceleration, entry speed.
    """
    n = 0
    ux = uy = uz = 0.0
    for i in range(1, len(points)):
        dx = points[i, 0] - points[i - 1, 0]
        dy = points[i, 1] - points[i - 1, 1]
        dz = points[i, 2] - points[i - 1, 2]
        length, feed, acceleration = segment_limits(
            dx, dy, dz, feeds[i], limits[0], limits[1], limits[2], limits[3]
        )
        if length <= 0.0 or feed <= 0.0:
            continue
        vx, vy, vz = dx / length, dy / length, dz / length
        corner = 0.0
        if n > 0:
            turn = np.sqrt((vx - ux) ** 2 + (vy - uy) ** 2 + (vz - uz) ** 2)
            corner = min(feed, scratch[n - 1, 1])
            if turn * corner > limits[4]:
                corner = limits[4] / turn
        scratch[n, 0], scratch[n, 1], scratch[n, 2] = length, feed, acceleration
        scratch[n, 3] = corner
        ux, uy, uz = vx, vy, vz
        n += 1
    return sweep_speeds(scratch, n)


@kernel
def sweep_speeds(scratch: NDArray[np.float64], n: int) -> float:
    """Lower the entry speeds (column 3) to what braking and ramps allow; return the time."""
    after = 0.0
    for i in range(n - 1, -1, -1):
        reach = np.sqrt(after * after + 2.0 * scratch[i, 2] * scratch[i, 0])
        scratch[i, 3] = min(scratch[i, 3], reach)
        after = scratch[i, 3]
    total = 0.0
    speed = 0.0
    for i in range(n):
        reach = np.sqrt(speed * speed + 2.0 * scratch[i, 2] * scratch[i, 0])
        leave = min(scratch[i + 1, 3], reach) if i + 1 < n else 0.0
        total += trapezoid_time(scratch[i, 0], speed, leave, scratch[i, 1], scratch[i, 2])
        speed = leave
    return total


@kernel
def polyline_times(
    points: NDArray[np.float64],
    offsets: NDArray[np.int64],
    feeds: NDArray[np.float64],
    limits: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Time of each polyline points[offsets[i]:offsets[i + 1]], (n,)."""
    n = len(offsets) - 1
    longest = 0
    for i in range(n):
        longest = max(longest, offsets[i + 1] - offsets[i])
    scratch = np.empty((longest + 1, 4))
    times = np.empty(n)
    for i in range(n):
        a, b = offsets[i], offsets[i + 1]
        times[i] = polyline_time(points[a:b], feeds[a:b], limits, scratch)
    return times
