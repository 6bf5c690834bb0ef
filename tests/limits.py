"""Motion limits for tests that reckon times by hand: no jerk, so every change is a stop."""

from __future__ import annotations

from decmcts.print.machine import MotionLimits

LIMITS = MotionLimits(
    max_feed=(200.0, 200.0, 10.0, 40.0),
    max_acceleration=(5000.0, 5000.0, 100.0, 5000.0),
    jerk=(0.0, 0.0, 0.0, 0.0),
    acceleration=1000.0,
    retract_acceleration=800.0,
    travel_acceleration=2000.0,
)
