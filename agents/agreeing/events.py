"""What happens to an agent and what it wants done: the protocol's vocabulary.

Events go into `agents.agreeing.protocol.Protocol.handle`, effects come out. Frozen, no
behaviour; `agents.extruder` (real) and the tests (simulated) carry them out.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from agents.messages.kinds import (
    SILENCE_TICKS,
    Distribution,
    Envelope,
    Joint,
    Message,
    Plans,
    Presence,
    Proposal,
)


class Phase(Enum):
    """Where one agent is."""

    PLANNING = "planning"
    AGREEING = "agreeing"
    RELEASED = "released"
    LEFT = "left"


# Events ---------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class PlanningEnded:
    """Our time is up, or the user wants the best so far."""


@dataclass(frozen=True, slots=True)
class PlanResolved:
    """The answer to `Resolve`: what the claimed digest's plans really give."""

    live: tuple[int, ...]
    claimed: str
    digest: str
    makespan_s: float


@dataclass(frozen=True, slots=True)
class HeadFenced:
    """Who may say so says: this incarnation of a head is off or parked for good."""

    head: int
    epoch: int


@dataclass(frozen=True, slots=True)
class Tick:
    """Some time passed: say again what may have been lost."""

    within: int = SILENCE_TICKS  # we speak again within so many ticks


@dataclass(frozen=True, slots=True)
class Leave:
    """We are asked to go."""

    reason: str


ProtocolEvent = (
    Presence
    | Envelope  # a well-formed message of another head
    | Distribution  # our planner has a new one to share
    | Joint  # our planner knows a joint plan worth telling
    | PlanningEnded
    | Proposal  # our planner's answer to `Propose`
    | PlanResolved
    | HeadFenced
    | Tick
    | Leave
)
"""What happens to an agent; messages alone are those of our own planner."""

# Effects --------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class Send:
    """Publish a message to all."""

    message: Message


@dataclass(frozen=True, slots=True, eq=False)
class Take:
    """Give what a peer sent to the planner, which may keep a joint plan."""

    head: int
    message: Distribution | Joint


@dataclass(frozen=True, slots=True)
class Forget:
    """Drop what the planner knows of a peer."""

    head: int


@dataclass(frozen=True, slots=True)
class LiveChanged:
    """Plan for these heads from now on."""

    live: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class RosterComplete:
    """Every head is greeted or fenced: the clock of the planning time starts."""


@dataclass(frozen=True, slots=True)
class Propose:
    """Stop planning; answer with a `Proposal` for this live set."""

    live: tuple[int, ...]
    serial: bool = False  # the explicit order, not the best plan


@dataclass(frozen=True, slots=True, eq=False)
class Resolve:
    """Resolve these plans and answer with `PlanResolved`."""

    live: tuple[int, ...]
    plans: Plans
    claimed: str


@dataclass(frozen=True, slots=True)
class Unfenced:
    """These heads are neither with us nor fenced: nothing is released before they are."""

    heads: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class PlanReleased:
    """Final: every live head agreed to this plan, every other head is fenced."""

    live: tuple[int, ...]
    plans: Plans
    makespan_s: float
    digest: str


@dataclass(frozen=True, slots=True)
class Refused:
    """A peer is not heard, and why, with its name."""

    head: int
    reason: str


@dataclass(frozen=True, slots=True)
class LogNote:
    """Something people may want to read in the log."""

    text: str


@dataclass(frozen=True, slots=True)
class Left:
    """We are out; nothing follows."""

    reason: str


Notice = LogNote | Refused | Unfenced | PlanReleased | Left
"""Effects that whoever watches an agent is shown."""

Effect = Send | Take | Forget | LiveChanged | RosterComplete | Propose | Resolve | Notice
