"""How fast controllers move, against figures found by hand."""

from __future__ import annotations

import numpy as np
import pytest

from sim.controllers.motion import profile_of
from tests.sim.controllers.programs import LIMITS, program


def test_a_long_move_is_a_trapezoid_from_jerk_to_jerk():
    """10 to 100 mm/s at 1000 mm/s² takes 0.09 s and 4.95 mm, twice; the rest is at 100 mm/s."""
    profile = profile_of(program([[0, 0, 0], [100, 0, 0]]))
    assert profile.enters[0] == profile.leaves[0] == pytest.approx(10.0)
    assert profile.top[0] == pytest.approx(100.0)
    assert profile.seconds[0] == pytest.approx(0.18 + (100 - 9.9) / 100)


def test_a_straight_way_in_two_moves_takes_what_one_move_takes():
    """Look-ahead: no speed is lost where nothing turns."""
    one = profile_of(program([[0, 0, 0], [100, 0, 0]]))
    two = profile_of(program([[0, 0, 0], [30, 0, 0], [100, 0, 0]]))
    assert two.seconds.sum() == pytest.approx(one.seconds.sum())


def test_a_head_rests_where_it_is_told_to():
    profile = profile_of(program([[0, 0, 0], [50, 0, 0], [100, 0, 0]], rest=(1,)))
    assert profile.leaves[0] == profile.enters[1] == pytest.approx(10.0)


def test_a_short_queue_costs_speed():
    """Of 200 moves of 0.2 mm a queue of 4 sees 0.8 mm ahead, and must be able to stop there."""
    points = np.column_stack([np.linspace(0, 40, 201), np.zeros(201), np.zeros(201)])
    fast, slow = (profile_of(program(points), queue) for queue in (1000, 4))
    reach = np.sqrt(10.0**2 + 2 * 1000 * 0.2 * 3)
    assert slow.leaves.max() <= reach + 1e-6
    assert slow.seconds.sum() > fast.seconds.sum()
    assert fast.leaves.max() == pytest.approx(100.0)


@pytest.mark.parametrize("seed", range(20))
def test_no_profile_breaks_a_limit(seed):
    """Speeds join, and no move speeds up or brakes harder than its limits allow."""
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(scale=3.0, size=(60, 3)) * [1, 1, 0.05], axis=0)
    profile = profile_of(program(points, feed=150.0, rest=(20, 40)), int(rng.integers(2, 20)))
    gained = np.abs(profile.leaves**2 - profile.enters**2)
    assert (gained <= 2 * profile.rate * profile.length + 1e-6).all()
    assert (np.maximum(profile.enters, profile.leaves) <= profile.top + 1e-9).all()
    assert (profile.rate <= LIMITS.acceleration + 1e-9).all()
    up = (2 * profile.top**2 - profile.enters**2 - profile.leaves**2) / (2 * profile.rate)
    assert (up <= profile.length + 1e-6).all()


def test_moves_that_move_nothing_take_no_time_and_stop_nobody():
    still = profile_of(program([[0, 0, 0], [50, 0, 0], [50, 0, 0], [100, 0, 0]]))
    one = profile_of(program([[0, 0, 0], [100, 0, 0]]))
    assert still.seconds[1] == 0.0
    assert still.seconds.sum() == pytest.approx(one.seconds.sum())
