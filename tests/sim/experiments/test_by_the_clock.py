"""Programs by the clock: as planned when nobody is late, and blind to who is."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.experiments.timing import by_the_clock
from sim.controllers.carry_out import carry_out
from sim.controllers.program import HeadProgram, StopKind
from sim.controllers.timing import Error, no_error
from tests.sim.controllers.programs import program

SECONDS = [np.array([10.0, 4.0]), np.array([3.0, 5.0])]
REST_S = 0.5


def two() -> tuple[HeadProgram, ...]:
    """The right head's second move waits until the left head's first is done, and 2 s more."""
    points = [(0, 0, 0), (10, 0, 0), (20, 0, 0)]
    left = program(points, stops=[(1, StopKind.SIGNAL, 0, 0.0)])
    right = program(points, stops=[(1, StopKind.WAIT, 0, 2.0)], name="right")
    return left, right


def run_late(programs: tuple[HeadProgram, ...], by: float) -> list[float]:
    """Return when each head ends if the left one's moves take `by` times as long."""
    errors = [Error(np.full(2, by), np.zeros(2)), no_error(programs[1])]
    return [head.end_s for head in carry_out(programs, SECONDS, errors, REST_S).heads]


def test_by_the_clock_nobody_waits_for_anybody() -> None:
    """At planned times both ways are the same; else what one suffers could come from the way."""
    programs = two()
    planned = carry_out(programs, SECONDS, [no_error(p) for p in programs], REST_S)
    clock = by_the_clock(programs, planned)
    assert run_late(clock, 1.0) == pytest.approx(run_late(programs, 1.0))
    assert run_late(programs, 1.5)[1] == pytest.approx(run_late(programs, 1.0)[1] + 5.0)
    assert run_late(clock, 1.5)[1] == pytest.approx(run_late(clock, 1.0)[1])
