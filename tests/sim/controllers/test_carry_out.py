"""Who waits for whom, and for how long."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim.controllers.carry_out import carry_out
from sim.controllers.motion import profile_of
from sim.controllers.program import HotEnd, StopKind
from sim.controllers.timing import Error, Timing, draw, no_error
from tests.sim.controllers.programs import program

WAY = [[0, 0, 0], [50, 0, 0], [100, 0, 0]]


def run(*programs, rest_s=0.0, errors=None):
    seconds = [profile_of(each).seconds for each in programs]
    return carry_out(programs, seconds, errors or [no_error(p) for p in programs], rest_s), seconds


def test_a_head_goes_on_when_the_other_has_moved():
    """Not when the move was queued: the signal is given when the move above it ends."""
    gives = program(WAY, stops=[(1, StopKind.PASS, 0, 0.0)])
    waits = program(WAY, stops=[(0, StopKind.WAIT, 0, 0.0)], name="right")
    found, seconds = run(gives, waits, rest_s=0.3)
    assert found.heads[1].begin[0] == pytest.approx(seconds[0][0] + 0.3)
    assert found.heads[1].by.tolist() == [0]
    assert found.heads[0].end_s == pytest.approx(seconds[0].sum())  # in motion: it loses nothing


def test_a_signal_at_rest_costs_its_own_head_a_start():
    gives = program(WAY, stops=[(1, StopKind.SIGNAL, 0, 0.0)])
    waits = program(WAY, stops=[(2, StopKind.WAIT, 0, 0.0)], name="right")
    found, seconds = run(gives, waits, rest_s=0.3)
    assert found.heads[0].end_s == pytest.approx(seconds[0].sum() + 0.3)
    assert found.heads[1].by.tolist() == [-1]  # it was given long ago


def test_a_lag_passes_after_the_signal():
    gives = program(WAY, stops=[(0, StopKind.PASS, 0, 0.0)])
    waits = program(WAY, stops=[(0, StopKind.WAIT, 0, 2.5)], name="right")
    found, _ = run(gives, waits)
    assert found.heads[1].begin[0] == pytest.approx(2.5)


def test_heads_that_wait_for_each_other_are_reported():
    """Such files never end; nothing hangs here."""
    one = program(WAY, stops=[(1, StopKind.WAIT, 0, 0.0), (2, StopKind.PASS, 1, 0.0)])
    two = program(WAY, stops=[(1, StopKind.WAIT, 1, 0.0), (2, StopKind.PASS, 0, 0.0)])
    found, _ = run(one, two)
    assert found.stuck == ((0, 0), (1, 0))
    assert np.isinf(found.heads[0].end_s)
    assert np.isinf(found.heads[0].begin[1])
    assert np.isfinite(found.heads[0].begin[0])


def test_late_moves_make_the_other_wait():
    gives = program(WAY, stops=[(1, StopKind.PASS, 0, 0.0)])
    waits = program(WAY, stops=[(0, StopKind.WAIT, 0, 0.0)], name="right")
    late = Error(np.array([2.0, 1.0]), np.array([5.0, 0.0]))
    found, seconds = run(gives, waits, errors=[late, no_error(waits)])
    assert found.heads[1].begin[0] == pytest.approx(2 * seconds[0][0] + 5.0)


def hot(stops):
    """A program whose hot end is at 210 °C when it is first told something, after 0 moves."""
    return replace(program(WAY, stops=stops), hot_end=HotEnd(210.0, heat_c_s=2.0, cool_c_s=1.0))


def test_a_hot_end_that_cooled_is_waited_for():
    """It cools by 30 °C in 30 s, is heated for 5 s while the head dwells, and lacks 20 °C."""
    tell, heat = StopKind.TARGET, StopKind.HEAT
    late = [(0, tell, -1, 150.0), (0, StopKind.DWELL, -1, 30.0), (0, tell, -1, 210.0),
            (0, StopKind.DWELL, -1, 5.0), (0, heat, -1, 210.0)]  # fmt: skip
    found, _ = run(hot(late))
    assert found.heads[0].begin[0] == pytest.approx(30.0 + 5.0 + 10.0)


def test_a_hot_end_heated_in_time_costs_nothing():
    """No colder than it was told to be, however long it stands; hot before the wait is over."""
    tell, heat = StopKind.TARGET, StopKind.HEAT
    rows = [(0, tell, -1, 190.0), (0, StopKind.DWELL, -1, 300.0), (0, tell, -1, 210.0),
            (0, StopKind.DWELL, -1, 10.0), (0, heat, -1, 210.0)]  # fmt: skip
    found, _ = run(hot(rows))
    assert found.heads[0].begin[0] == pytest.approx(310.0)


def test_a_temperature_that_nothing_waits_for_stops_no_head():
    """Moves around it stay joined, as around a signal in motion."""
    told = hot([(1, StopKind.TARGET, -1, 150.0)])
    assert not told.rests[1]
    assert run(told)[0].heads[0].end_s == pytest.approx(run(program(WAY))[0].heads[0].end_s)


@pytest.mark.parametrize("timing", [Timing.UNIFORM, Timing.HEAVY_TAILS, Timing.DRIFT])
def test_errors_come_from_their_seed_and_belong_to_actions(timing):
    """Moves of one action are late by the same factor."""
    points = np.column_stack([np.arange(2001.0), np.zeros(2001), np.zeros(2001)])
    made = program(points, rest=range(0, 2000, 10))
    one, same, other = (draw(timing, made, 0.5, np.random.default_rng(s)) for s in (1, 1, 2))
    assert np.array_equal(one.factor, same.factor)
    assert np.array_equal(one.stall_s, same.stall_s)
    assert not np.array_equal(one.factor + one.stall_s, other.factor + other.stall_s)
    assert (one.factor.reshape(200, 10) == one.factor[::10, None]).all()
    assert one.factor.min() > 0.0
