"""An agent as its launcher sees it: what is done to it, and what was heard of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field


class LaunchError(Exception):
    """The agents came to no plan; one line says why, and `agents` what became of each."""

    agents: tuple[AgentStatus, ...] = ()


@dataclass(frozen=True, slots=True)
class AgentStatus:
    """What the launcher last heard of one agent."""

    head: int
    name: str
    phase: str = "starting"
    live: tuple[int, ...] = ()
    rounds: int = 0
    best_makespan_s: float = float("inf")
    elapsed_s: float = 0.0
    sent: Mapping[str, int] = field(default_factory=dict)  # messages by kind
    sent_bytes: Mapping[str, int] = field(default_factory=dict)
    received: Mapping[str, int] = field(default_factory=dict)
    received_bytes: Mapping[str, int] = field(default_factory=dict)
    dropped: Mapping[str, int] = field(default_factory=dict)  # by reason
    history: tuple[tuple[float, float], ...] = ()  # (elapsed s, best makespan s), improvements
    entropy: float = 1.0  # of the plans it last stated: 0 decided, 1 all alike
    note: str = ""
    again: str = ""  # how the process before it died; empty: it is the first
    stuck: bool = False  # the heads it hears cannot print everything
    agreeing_s: float | None = None  # from the end of planning, to the release in the end


REPORTED = (
    "phase", "rounds", "best_makespan_s", "elapsed_s", "agreeing_s", "stuck", "entropy",
)  # fmt: skip
"""Fields that an agent's lines of progress name alike."""

OnProgress = Callable[[tuple[AgentStatus, ...]], None]

StartAgain = Callable[[int, int, float, Sequence[str] | None], None]
"""Starts the agent of a head anew, with an epoch, seconds to plan, and places if all moved."""
