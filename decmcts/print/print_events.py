"""What happens while a print is carried out, as all who take part report it.

Simulated controllers, the agents that carry a plan out, reports and replanning use this one type.
docs/events.md has the schema; `agents.messages.event_stream` reads and writes it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

NO_ACTION = -1


class EventKind(StrEnum):
    """What an event reports."""

    BEGAN = "began"  # an action
    PASSED = "passed"  # a point of its path, which some other head waits for
    ENDED = "ended"  # an action
    WAITS = "waits"  # an action stands until another head has signalled
    FAILED = "failed"  # the head prints no more


@dataclass(frozen=True, slots=True)
class PrintEvent:
    """One event of one head.

    `action` counts the head's actions in the plan; in files without a plan, the stretches from one
    stop of the head to its next.
    """

    kind: EventKind
    head: int  # place of the head in the plan
    time_s: float  # since the print began
    action: int = NO_ACTION
    point: int = 0  # of the action's path: points that the nozzle has passed; 0: it has not begun
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)  # where the nozzle is, mm
    by: int = -1  # WAITS: the head that is waited for
    line: int = 0  # of the head's file, from 1; 0: no file
    what: str = ""  # FAILED: why


@dataclass(frozen=True, slots=True)
class EventLog:
    """The events of a print in the order of their times."""

    problem: str  # digest of the plan that is carried out; empty: files without a plan
    heads: tuple[str, ...]  # their names, as in the plan
    events: tuple[PrintEvent, ...]
