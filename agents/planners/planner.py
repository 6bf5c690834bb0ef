"""What an agent needs of a planner, and the team's planner behind that face.

The agent loop (`agents.loop.agent`) sees only `AgentPlanner`; the computing is
`decmcts.team`'s. Tests put a small planner of their own behind the same face.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from agents.messages.kinds import Distribution, Joint, Plans, Proposal


class AgentPlanner(Protocol):
    """One head's planner.

    `take`, `offer` and `resolve` raise `MessageError` for sequences that name work
    the problem does not have, since these come from outside. Every method that takes
    the live heads raises `InputError` if they cannot print everything.
    """

    @property
    def problem(self) -> str:
        """Digest of the problem."""

    @property
    def most_symbols(self) -> int:
        """Numbers in all plans of a message that may mean something for this problem."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all heads."""

    def iterate(self, live: Sequence[int], spent: float) -> None:
        """Do one round of planning for the live heads; `spent` of the time, 0..1, is over."""

    def distribution(self) -> Distribution:
        """Return what peers need to know of our intentions."""

    def take(self, head: int, distribution: Distribution) -> None:
        """Use a peer's latest distribution."""

    def forget(self, head: int) -> None:
        """Drop what is known of a peer."""

    def best_joint(self, live: Sequence[int]) -> Joint:
        """Return the best joint plan known as it was judged, cheaply."""

    def offer(self, plans: Plans, live: Sequence[int]) -> None:
        """Judge a peer's joint plan; keep it if it is the best here too."""

    def best(self, live: Sequence[int]) -> Proposal:
        """Return the best joint plan known for the live heads."""

    def resolve(self, plans: Plans, live: Sequence[int]) -> Proposal:
        """Return what plans resolve to; the same, bit for bit, on every agent.

        Of plans that state a serial order, the digest is of that order alone, and
        the order is checked, not computed.
        """

    def serial(self, live: Sequence[int]) -> Proposal:
        """Return a joint plan that states who prints what in which order, one after the other.

        What agents agree on when the same plans resolve differently on their hosts.
        """
