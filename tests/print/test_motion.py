"""The time model against hand-computed moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.print.contours import Contours
from decmcts.print.job import ProcessSettings
from decmcts.print.machine import MotionLimits
from decmcts.print.motion import contour_times, path_time, retraction_time, travel_feed

NO_JERK = (0.0, 0.0, 0.0, 0.0)
LIMITS = MotionLimits(
    travel_feed=150.0,
    max_feed=(200.0, 200.0, 10.0, 40.0),
    max_acceleration=(5000.0, 5000.0, 100.0, 5000.0),
    jerk=NO_JERK,
    acceleration=1000.0,
    retract_acceleration=800.0,
    travel_acceleration=1000.0,
)
JERKY = replace(LIMITS, jerk=(10.0, 10.0, 1.0, 5.0))


def _time(points: list[tuple[float, float, float]], feed: float) -> float:
    return path_time(np.array(points, dtype=float), feed, LIMITS)


def test_long_move_cruises() -> None:
    """A move long enough to cruise takes length/feed plus one ramp time."""
    assert _time([(0, 0, 0), (100, 0, 0)], 100.0) == pytest.approx(1.0 + 0.1)


def test_short_move_never_reaches_its_feed() -> None:
    """A triangle profile takes 2·sqrt(length/acceleration)."""
    assert _time([(0, 0, 0), (1, 0, 0)], 100.0) == pytest.approx(2 * np.sqrt(1 / 1000))


def test_collinear_points_cost_nothing() -> None:
    """Splitting a straight move must not change its time, or densified contours would look slow."""
    whole = _time([(0, 0, 0), (30, 0, 0)], 80.0)
    split = _time([(0, 0, 0), (0.1, 0, 0), (7, 0, 0), (7, 0, 0), (30, 0, 0)], 80.0)
    assert split == pytest.approx(whole)


def test_rest_begins_and_ends_at_the_jerk() -> None:
    """Firmware starts and stops a move at the axis' jerk, not at zero: 100 mm at 60, 10 at ends."""
    ramps = 2 * (60 - 10) / 1000
    flat = 100 - 2 * (60**2 - 10**2) / 2000
    path = np.array([[0.0, 0, 0], [100, 0, 0]])
    assert path_time(path, 60.0, JERKY) == pytest.approx(ramps + flat / 60)


def test_a_right_angle_is_taken_at_the_jerk() -> None:
    """From X to Y both axes jump by the corner's speed, so that is the jerk: 10 mm/s."""
    path = np.array([[0.0, 0, 0], [50, 0, 0], [50, 50, 0]])
    leg = 2 * (60 - 10) / 1000 + (50 - (60**2 - 10**2) / 1000) / 60
    assert path_time(path, 60.0, JERKY) == pytest.approx(2 * leg)


def test_an_axis_that_turns_back_passes_through_zero() -> None:
    """Marlin lets each side of a reversal have the whole jerk."""
    path = np.array([[0.0, 0, 0], [50, 0, 0], [0, 0, 0]])
    leg = 2 * (60 - 10) / 1000 + (50 - (60**2 - 10**2) / 1000) / 60
    assert path_time(path, 60.0, JERKY) == pytest.approx(2 * leg)


def test_junction_deviation_limits_a_right_angle() -> None:
    """v² = a·d·s/(1 - s) with s = sin 45°, from rest to rest (Marlin, Klipper)."""
    limits = replace(JERKY, junction_deviation=0.05)
    half = np.sqrt(0.5)
    corner = np.sqrt(1000 * 0.05 * half / (1 - half))
    path = np.array([[0.0, 0, 0], [50, 0, 0], [50, 50, 0]])
    leg = (60 + 60 - corner) / 1000 + (50 - (2 * 60**2 - corner**2) / 2000) / 60
    assert path_time(path, 60.0, limits) == pytest.approx(2 * leg)


def test_the_slowest_axis_limits_a_slope() -> None:
    """45° up: Z at 10 mm/s and 100 mm/s² allows √2 of each along the path."""
    path = np.array([[0.0, 0, 0], [20, 0, 20]])
    top, rate, length = 10 * np.sqrt(2), 100 * np.sqrt(2), 20 * np.sqrt(2)
    assert path_time(path, 150.0, LIMITS) == pytest.approx(length / top + top / rate)


def test_lift_is_limited_by_the_z_axis() -> None:
    """Z is slow: a lift obeys its feed and its acceleration."""
    assert _time([(0, 0, 0), (0, 0, 20)], 150.0) == pytest.approx(20 / 10 + 10 / 100)


def test_feed_is_capped_by_the_machine() -> None:
    """A source that asks for more than the machine has gets what the machine has."""
    fast = _time([(0, 0, 0), (500, 0, 0)], 1e4)
    assert fast == pytest.approx(_time([(0, 0, 0), (500, 0, 0)], 200.0))


@pytest.mark.parametrize("points", [[(1.0, 2.0, 3.0)], [(1.0, 2.0, 3.0), (1.0, 2.0, 3.0)]])
def test_standing_still_takes_no_time(points: list[tuple[float, float, float]]) -> None:
    """Zero length is common in real files and must not divide by zero."""
    assert _time(points, 100.0) == 0.0


def test_time_is_the_same_reversed() -> None:
    """Planners reverse contours without pricing them again."""
    rng = np.random.default_rng(3)
    path = rng.uniform(0, 20, (40, 3)) * [1, 1, 0.1]
    there = path_time(path, 60.0, LIMITS)
    assert path_time(path[::-1], 60.0, LIMITS) == pytest.approx(there)


def test_never_faster_than_the_feed_allows() -> None:
    """A lower bound on any path: its length over its feed."""
    rng = np.random.default_rng(4)
    path = rng.uniform(0, 5, (60, 3)) * [1, 1, 0]
    length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    assert path_time(path, 60.0, LIMITS) >= length / 60.0


def test_contour_times_use_each_segments_feed() -> None:
    """A slow first layer or bridge must cost its own feed."""
    feed = np.array([0.0, 50.0, 0.0, 25.0])
    points = np.array([[0, 0, 0.2], [100, 0, 0.2], [0, 5, 0.2], [100, 5, 0.2]], dtype=float)
    n = 2
    contours = Contours(
        points=points,
        offsets=np.array([0, 2, 4]),
        extrusion=np.array([0.0, 1, 0, 1]),
        feed=feed,
        width=np.full(n, 0.45),
        height=np.full(n, 0.2),
        role=np.zeros(n, np.int8),
        closed=np.zeros(n, np.bool_),
        layer=np.zeros(n, np.int32),
        tool=np.zeros(n, np.int16),
        reversible=np.ones(n, np.bool_),
        epoch=np.zeros(n, np.int32),
        line=np.zeros(n, np.int32),
    )
    assert contour_times(contours, LIMITS) == pytest.approx([2.0 + 0.05, 4.0 + 0.025])
    set_500 = np.array([np.nan, 500.0, np.nan, np.nan])  # M204 P500 in the first
    assert contour_times(contours, LIMITS, set_500) == pytest.approx([2.0 + 0.1, 4.0 + 0.025])


def test_a_retraction_pulls_and_pushes_the_filament() -> None:
    """Both from rest to rest; a source that never retracts pays nothing."""
    settings = ProcessSettings(retract_mm=2.0, retract_feed=40.0, unretract_feed=20.0)
    due = 2 / 40 + 40 / 800 + 2 / 20 + 20 / 800
    assert retraction_time(settings, LIMITS) == pytest.approx(due)
    assert retraction_time(ProcessSettings(), LIMITS) == 0.0


def test_a_wipe_takes_its_part_of_the_retraction() -> None:
    """A wipe there and back adds its way and takes its filament off the pull at rest."""
    settings = ProcessSettings(
        retract_mm=2.0, retract_feed=40.0, unretract_feed=20.0,
        wipe_mm=4.0, wipe_filament_mm=1.0, wipe_feed=10.0,
    )  # fmt: skip
    pull, push = 2 * np.sqrt(1 / 800), 2 / 20 + 20 / 800  # 1 mm is too short to reach 40 mm/s
    wipe = 2 * (2 / 10 + 10 / 1000)
    assert retraction_time(settings, LIMITS) == pytest.approx(pull + push + wipe)


def test_limits_that_say_nothing_change_nothing() -> None:
    """A source without limits leaves the machine's; one with some wins where it speaks."""
    assert LIMITS.under(MotionLimits.unstated()) == LIMITS
    nan = float("nan")
    said = replace(MotionLimits.unstated(), max_feed=(nan, nan, 12.0, nan), acceleration=700.0)
    both = LIMITS.under(said)
    assert both.max_feed == (200.0, 200.0, 12.0, 40.0)
    assert both.acceleration == 700.0 and both.jerk == LIMITS.jerk


def test_travel_feed_prefers_the_source() -> None:
    """The source's own travel feed wins; without one the machine's counts."""
    assert travel_feed(ProcessSettings(travel_feed=90.0), LIMITS) == 90.0
    assert travel_feed(ProcessSettings(), LIMITS) == 150.0
