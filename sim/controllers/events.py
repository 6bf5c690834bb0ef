"""The events of a simulated run, in the schema of all who carry prints out."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from decmcts.print.print_events import EventKind, EventLog, PrintEvent
from sim.controllers.program import StopKind, place_of
from sim.controllers.simulate import Simulation


def events_of(simulation: Simulation, problem: str = "") -> EventLog:
    """Return what happened without errors of time, from when the print began."""
    found = sorted(_events(simulation), key=lambda event: (event.time_s, event.head))
    names = tuple(program.name for program in simulation.programs)
    return EventLog(problem, names, tuple(found))


def _events(simulation: Simulation) -> Iterator[PrintEvent]:
    zero = simulation.begin_s
    for h, (program, run) in enumerate(zip(simulation.programs, simulation.run.heads, strict=True)):
        firsts, lasts = program.moves_of_actions()
        for i, k in zip(firsts.tolist(), lasts.tolist(), strict=True):
            action = int(program.action[i])
            for kind, move, times, point in (
                (EventKind.BEGAN, i, run.begin, 0), (EventKind.ENDED, k, run.end, k - i + 1),
            ):  # fmt: skip
                if zero <= times[move] < np.inf:
                    place = program.points[move + (kind == EventKind.ENDED)]
                    yield PrintEvent(
                        kind, h, float(times[move]) - zero, action, point, place_of(place),
                        line=int(program.line[move]),
                    )  # fmt: skip
        first_of = dict(zip(program.action[firsts].tolist(), firsts.tolist(), strict=True))
        for j in range(len(program.stops)):
            move = min(int(program.stops.before[j]), len(program.action) - 1)
            stop, time = int(program.stops.kind[j]), float(run.reached[j]) - zero
            if not 0.0 <= time < np.inf or move < 0:
                continue
            place = place_of(program.points[program.stops.before[j]])
            line, action = int(program.line[move]), int(program.action[move])
            if stop == StopKind.WAIT and run.by[j] >= 0:
                by = int(run.by[j])
                yield PrintEvent(EventKind.WAITS, h, time, action, 0, place, by, line)
            elif stop == StopKind.PASS:
                point = int(program.stops.before[j]) - first_of[action]
                if point > 0:
                    yield PrintEvent(EventKind.PASSED, h, time, action, point, place, line=line)
