"""How long motion takes: the planner's time model.

Trapezoids with look-ahead under the machine's limits, from rest to rest for
every contour and every travel. The judge (`sim.motion`) has its own model;
nothing here is imported there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.motion import polyline_times
from decmcts.print.contours import Contours
from decmcts.print.job import ProcessSettings
from decmcts.print.machine import MotionLimits


def limit_array(limits: MotionLimits) -> NDArray[np.float64]:
    """Return the limits as the kernels take them: max and z feed, accelerations, jerk, (5,)."""
    return np.array(
        [
            limits.max_feed,
            limits.z_feed,
            limits.acceleration,
            limits.z_acceleration,
            limits.jerk,
        ]
    )


def contour_times(contours: Contours, limits: MotionLimits) -> NDArray[np.float64]:
    """Return the seconds each contour takes as sliced, (n,).

    The model is symmetric in time, so a contour run backwards takes as long.
    """
    return path_times(contours.points, contours.offsets, contours.feed, limits)


def path_times(
    points: NDArray[np.float64],
    offsets: NDArray[np.int64],
    feed: NDArray[np.float64],
    limits: MotionLimits,
) -> NDArray[np.float64]:
    """Return the seconds of each polyline points[offsets[i]:offsets[i + 1]], (n,).

    Parameters
    ----------
    points : (m, 3) mm
    offsets : (n + 1,)
    feed : (m,) mm/s of the segment ending at each point; segments without feed take no time
    limits : MotionLimits
    """
    return np.asarray(polyline_times(points, offsets, feed, limit_array(limits)))


def path_time(path: NDArray[np.float64], feed: float, limits: MotionLimits) -> float:
    """Return the seconds one polyline (k, 3) takes at `feed` mm/s, from rest to rest.

    Examples
    --------
    >>> from decmcts.print.machine import MotionLimits
    >>> import numpy as np
    >>> limits = MotionLimits(acceleration=1000.0)
    >>> round(path_time(np.array([[0.0, 0, 0], [100, 0, 0]]), 100.0, limits), 6)
    1.1
    """
    offsets = np.array([0, len(path)], np.int64)
    points = np.ascontiguousarray(path, np.float64)
    return float(path_times(points, offsets, np.full(len(path), feed), limits)[0])


def travel_feed(settings: ProcessSettings, limits: MotionLimits) -> float:
    """Return the feed of travels in mm/s: the source's own, or the machine's."""
    return settings.travel_feed if settings.travel_feed > 0.0 else limits.travel_feed


def retraction_time(settings: ProcessSettings, travel_mm: float) -> float:
    """Return the seconds a travel of `travel_mm` spends retracting and priming again."""
    if settings.retract_mm <= 0.0 or travel_mm < settings.retract_min_travel_mm:
        return 0.0
    return (
        settings.retract_mm / settings.retract_feed + settings.retract_mm / settings.unretract_feed
    )
