"""What an agent needs of a planner, and the team's planner behind that face.

The agent loop (`agents.agent`) sees only `Planner`; the computing is
`decmcts.team`'s. Tests put a small planner of their own behind the same face.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from agents.messages import Distribution, Plans


@dataclass(frozen=True, slots=True, eq=False)
class JointProposal:
    """A joint plan as sequences, with what it resolves to."""

    plans: Plans
    makespan_s: float
    digest: str


class Planner(Protocol):
    """One head's planner.

    `take` and `resolve` raise `MessageError` for sequences that name work the
    problem does not have: they come from outside. `iterate`, `best` and
    `resolve` raise `InputError` if the live heads cannot print everything.
    """

    @property
    def problem(self) -> str:
        """Digest of the problem."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all heads."""

    def iterate(self, live: Sequence[int]) -> None:
        """Do one round of planning for the live heads."""

    def distribution(self) -> Distribution:
        """Return what peers need to know of our intentions."""

    def take(self, head: int, distribution: Distribution) -> None:
        """Use a peer's latest distribution."""

    def forget(self, head: int) -> None:
        """Drop what is known of a peer."""

    def best_makespan_s(self, live: Sequence[int]) -> float:
        """Return the makespan of the best joint plan known, cheaply; infinite for none."""

    def best(self, live: Sequence[int]) -> JointProposal:
        """Return the best joint plan known for the live heads."""

    def resolve(self, plans: Plans, live: Sequence[int]) -> JointProposal:
        """Return what plans resolve to; the same, bit for bit, on every agent."""
