"""The judge's motion model against cases with a known answer."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.print.machine import MotionLimits
from sim.replay.motion import arrival_times

LIMITS = MotionLimits(
    max_feed=(100.0, 100.0, 10.0, 50.0),
    max_acceleration=(1000.0, 1000.0, 100.0, 1000.0),
    jerk=(0.0, 0.0, 0.0, 0.0),
    acceleration=1000.0,
    travel_acceleration=1000.0,
)


def seconds(points, feed=100.0, limits=LIMITS):
    path = np.array(points, float)
    full, prints = np.full(len(path), feed), np.ones(len(path), bool)
    return arrival_times(path, np.array([0, len(path)]), full, prints, limits)


def test_a_trapezoid():
    """100 mm at 100 mm/s and 1000 mm/s²: 0.1 s up, 0.1 s down, 90 mm at full speed."""
    assert seconds([[0, 0, 0], [100, 0, 0]])[-1] == pytest.approx(1.1)


def test_a_triangle():
    """10 mm do not reach full speed: 2·sqrt(10/1000)."""
    assert seconds([[0, 0, 0], [10, 0, 0]])[-1] == pytest.approx(0.2)


def test_a_straight_corner_costs_nothing():
    """Splitting a line does not slow the head down."""
    whole = seconds([[0, 0, 0], [100, 0, 0]])[-1]
    assert seconds([[0, 0, 0], [30, 0, 0], [100, 0, 0]])[-1] == pytest.approx(whole)


def test_a_sharp_corner_without_jerk_is_a_stop():
    """With no jump of velocity allowed the head comes to rest in a corner."""
    bent = seconds([[0, 0, 0], [50, 0, 0], [50, 50, 0]])[-1]
    assert bent == pytest.approx(2 * seconds([[0, 0, 0], [50, 0, 0]])[-1])


def test_z_has_limits_of_its_own():
    """A lift is slower than a travel of the same length."""
    assert seconds([[0, 0, 0], [0, 0, 10]])[-1] == pytest.approx(1.1)


def test_feed_limits_speed():
    """A print at 20 mm/s is not run at the machine's limit."""
    assert seconds([[0, 0, 0], [100, 0, 0]], feed=20.0)[-1] == pytest.approx(5.02)


def test_paths_without_length_take_no_time():
    """A wait in place and a doubled point are instantaneous."""
    assert seconds([[1, 2, 3]]).tolist() == [0.0]
    assert seconds([[1, 2, 3], [1, 2, 3], [1, 2, 3]]).tolist() == [0.0, 0.0, 0.0]


def test_each_path_starts_at_rest():
    """Two paths after each other take as long as each alone."""
    path = np.array([[0, 0, 0], [50, 0, 0], [50, 0, 0], [100, 0, 0]], float)
    times = arrival_times(path, np.array([0, 2, 4]), np.full(4, 100.0), np.ones(4, bool), LIMITS)
    assert times[1] == pytest.approx(times[3])
    assert times[2] == 0.0


def test_time_runs_forward_and_limits_hold():
    """Random paths: no segment is faster than its feed, and the order of time holds."""
    rng = np.random.default_rng(0)
    path = np.cumsum(rng.normal(size=(60, 3)) * [3, 3, 0.1], axis=0)
    feed = rng.uniform(5, 80, 60)
    times = arrival_times(path, np.array([0, 60]), feed, np.ones(60, bool), MotionLimits())
    length = np.linalg.norm(np.diff(path, axis=0), axis=1)
    assert (np.diff(times) >= length / feed[1:] - 1e-9).all()
