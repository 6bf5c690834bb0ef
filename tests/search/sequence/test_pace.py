"""What travels cost in seconds."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from decmcts.print.job import PrintJob, ProcessSettings
from decmcts.print.machine import MotionLimits
from decmcts.search.planners import plan_order
from decmcts.search.sequence.metric_kernels import distance
from decmcts.search.sequence.pace import pace_of
from decmcts.search.sequence.problem import Pace
from decmcts.search.sequence.stopping import Stopping
from tests.search.problems import random_problem
from tests.team.conftest import make_contours

LIMITS = MotionLimits(
    travel_feed=150.0,
    max_feed=(200.0, 180.0, 10.0, 40.0),
    max_acceleration=(5000.0, 5000.0, 100.0, 5000.0),
    jerk=(0.0, 0.0, 0.0, 0.0),
    retract_acceleration=800.0,
    travel_acceleration=2000.0,
)


def job_of(**settings: float) -> PrintJob:
    contours = make_contours([np.array([[0.0, 0.0, 0.2], [1.0, 0.0, 0.2]])], [0])
    return PrintJob("line", contours, ProcessSettings(**settings))


def test_the_sources_habits_under_the_machines_limits():
    """Retraction and priming at rest, the hop up and down; the axes cap feeds."""
    pace = pace_of(
        job_of(
            travel_feed=250.0, retract_mm=2.0, retract_feed=40.0, unretract_feed=20.0, hop_mm=0.5,
            retract_min_travel_mm=3.0,
        ),
        LIMITS,
    )  # fmt: skip
    lift = 2 * np.sqrt(0.5 / 100)  # too short to reach 10 mm/s
    hop = 2 / 40 + 40 / 800 + 2 / 20 + 20 / 800 + 2 * lift
    assert (pace.speed, pace.acceleration) == (180.0, 2000.0)
    assert (pace.z_speed, pace.z_acceleration) == (10.0, 100.0)
    assert pace.hop_s == pytest.approx(hop)
    assert pace.free_mm == np.nextafter(3.0, 0.0)  # one of just this length is retracted


def test_a_source_that_never_retracts_pays_nothing_extra():
    """Vases and sources without retraction."""
    assert pace_of(job_of(), LIMITS).hop_s == 0.0
    assert pace_of(job_of(), LIMITS).speed == 150.0


def test_travel_goes_across_and_upright_one_after_the_other():
    """30 mm across at 100 mm/s and 1000 mm/s², 5 mm up at 10 mm/s and 100 mm/s², and a hop."""
    problem = random_problem(0, 2, density=0.0)
    start = np.array([[0.0, 0, 0.2], [30.0, 0, 5.2]])
    pace = Pace(100.0, 1000.0, 10.0, 100.0, hop_s=0.25, free_mm=34.0)
    problem = replace(problem, start=start, end=start.copy(), pace=pace)
    due = 30 / 100 + 100 / 1000 + 5 / 10 + 10 / 100 + 0.25
    assert distance(problem.metric(), 0, 2) == pytest.approx(due)
    assert distance(problem.metric(), 0, 1) == 0.0
    assert problem.longest_travel() == pytest.approx(due)
    near = replace(problem, pace=replace(pace, free_mm=35.0))
    assert distance(near.metric(), 0, 2) == pytest.approx(due - 0.25)


@pytest.mark.slow
def test_a_search_for_time_finds_no_more_seconds_than_one_for_travel():
    """On the same problem, what is minimised must be no worse for being minimised."""
    problem = random_problem(5, 40, density=0.05)
    pace = Pace(150.0, 1500.0, 10.0, 100.0, hop_s=0.3, free_mm=2.0)
    timed = replace(problem, pace=pace)
    options = {"planner": "local", "seed": 1, "stopping": Stopping(iterations=400)}
    fast, short = plan_order(timed, **options), plan_order(problem, **options)
    assert fast.unit == "s" and short.unit == "mm"
    assert fast.cost <= fast.source_cost

    def seconds(result) -> float:
        metric, path = timed.metric(), result.toolpath
        ports = 2 * path.order + path.reversed
        return sum(distance(metric, a ^ 1, b) for a, b in pairwise(ports.tolist()))

    assert seconds(fast) == pytest.approx(fast.cost)
    assert seconds(fast) <= seconds(short) + 1e-9
