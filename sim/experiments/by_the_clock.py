"""The same programs by the clock: heads wait for times, not for one another.

The baseline of the literature on several printing robots: a central plan that trusts its clock.
Where a head waits for another's signal it waits until the moment at which it went on when all
took the planned time. At planned times both do the same.

References
----------
Journal of Mechanical Design 145(1) 012003, 2023: decentralised against centralised
planning of several printing robots, under timing error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sim.controllers.carry_out import Run
from sim.controllers.program import HeadProgram, StopKind, Stops


def by_the_clock(programs: Sequence[HeadProgram], planned: Run) -> tuple[HeadProgram, ...]:
    """Return programs without signals between heads.

    Each head starts a clock of its own when it begins, as a signal that only it waits for.
    `planned` is how the programs are carried out without errors of time.
    """
    given = _given(programs, planned)
    return tuple(
        replace(program, stops=_timed(program.stops, planned, h, given))
        for h, program in enumerate(programs)
    )


def _given(programs: Sequence[HeadProgram], planned: Run) -> dict[int, float]:
    """Return when each signal is given."""
    found = {}
    for program, run in zip(programs, planned.heads, strict=True):
        kinds = np.isin(program.stops.kind, (StopKind.SIGNAL, StopKind.PASS))
        for j in np.flatnonzero(kinds).tolist():
            found[int(program.stops.number[j])] = float(run.reached[j])
    return found


def _timed(stops: Stops, planned: Run, h: int, given: dict[int, float]) -> Stops:
    """Return the stops of one head; `value` of a wait becomes when it went on."""
    value, number = stops.value.copy(), stops.number.copy()
    for j in np.flatnonzero(stops.kind == StopKind.WAIT).tolist():
        ready = given[int(number[j])] + value[j]
        number[j], value[j] = h, max(ready, float(planned.heads[h].reached[j]))
    kind = stops.kind.copy()
    number[kind != StopKind.WAIT] = len(planned.heads)  # nobody waits for it
    return Stops(
        np.concatenate([[0], stops.before]), np.concatenate([[StopKind.PASS], kind]),
        np.concatenate([[h], number]), np.concatenate([[0.0], value]),
    )  # fmt: skip
