"""The events planning reports while it works, and how it is asked to stop.

The same for one head and for several. A report may be called from a second thread.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from agents.launching.status import AgentStatus
from decmcts.search.sequence.stopping import Progress

__all__ = ["Begun", "Event", "Heads", "Note", "Progress", "Report", "Sound", "Step", "Stop"]


@dataclass(frozen=True, slots=True)
class Step:
    """What is done next, in a few words, and which of how many steps in a row it is."""

    text: str
    number: int = 0  # from 1
    of: int = 0  # 0: alone, or not known


@dataclass(frozen=True, slots=True)
class Note:
    """Something a person should know, in one line."""

    text: str


@dataclass(frozen=True, slots=True)
class Sound:
    """The source's own order passed the judge, so a better one can be planned."""


@dataclass(frozen=True, slots=True)
class Begun:
    """A search has begun: from here on `stop` ends it with the best so far."""


@dataclass(frozen=True, slots=True)
class Heads:
    """Where the agents of all heads stand."""

    agents: tuple[AgentStatus, ...]  # none before they are started
    bound_s: float  # no joint plan ends earlier; 0: not known yet


Event = Step | Note | Sound | Begun | Heads | Progress
"""What a `Report` is called with."""

Report = Callable[[Event], None]
"""A function that is called with each event."""

Stop = Callable[[], bool]
"""Asked many times a second; True ends the search with the best so far."""


def unheard(event: Event) -> None:
    """Ignore the event."""


def never() -> bool:
    """Return False: nothing ends early."""
    return False
