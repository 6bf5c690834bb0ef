"""A plan carried out up to a moment: what has happened by then, and how far heads have come."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from decmcts.print.plan import PlanDocument
from decmcts.print.print_events import EventKind, EventLog, PrintEvent
from decmcts.print.print_state import HeadState
from sim.controllers.carry_out import Run, carry_out
from sim.controllers.motion import profile_of
from sim.controllers.program import HeadProgram
from sim.controllers.simulate import Simulation, events_of
from sim.controllers.timing import no_error


def log_until(simulation: Simulation, document: PlanDocument, head: int, time_s: float) -> EventLog:
    """Return what has happened up to a time at which a head stops for good."""
    log = events_of(simulation, document.problem)
    before = [event for event in log.events if event.time_s < time_s]
    program, run = simulation.programs[head], simulation.run.heads[head]
    at = simulation.positions(np.array([time_s]))[head][0]
    begun = [e.action for e in before if e.head == head and e.kind is EventKind.BEGAN]
    ended = [e.action for e in before if e.head == head and e.kind is EventKind.ENDED]
    action, point = (begun[-1], 0) if begun else (-1, 0)
    if begun and action not in ended:
        mine = program.action == action
        point = int(np.count_nonzero(run.end[mine] - simulation.begin_s <= time_s))
    x, y, z = at.tolist()
    failed = PrintEvent(
        EventKind.FAILED, head, time_s, action, point, (x, y, z), what="clogged"
    )  # fmt: skip
    return EventLog(log.problem, log.heads, (*before, failed))


def with_late_head(
    document: PlanDocument, programs: tuple[HeadProgram, ...], late: int, slower: float
) -> Run:
    """Carry a plan out while one head takes so many times as long."""
    errors = [no_error(program) for program in programs]
    errors[late] = replace(errors[late], factor=errors[late].factor * slower)
    seconds = [profile_of(program).seconds for program in programs]
    return carry_out(programs, seconds, errors, document.machine.rest_s)


def ended_by(
    document: PlanDocument, programs: tuple[HeadProgram, ...], run: Run, now: float,
    gone: Collection[int] = (),
) -> tuple[list[HeadState], float]:  # fmt: skip
    """Return how far heads are once each has ended what it began before now, and when that is.

    Nobody waits for those that are `gone`.
    """
    heads, until = list[HeadState](), now
    for h, (program, what) in enumerate(zip(programs, run.heads, strict=True)):
        begun = program.action[what.begin < now]
        count = int(begun[-1]) + 1 if len(begun) else 0
        if h not in gone:
            until = max(until, float(what.end[program.action < count].max(initial=0.0)))
        heads.append(HeadState(document.plan.heads[h].head, count))
    return heads, until
