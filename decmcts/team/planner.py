"""What a planner for several heads is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:  # options know planners, and load no compiler
    from decmcts.team.incumbent import TeamIncumbent


@runtime_checkable
class TeamPlanner(Protocol):
    """A way to find a good joint order."""

    def plan(self, incumbent: TeamIncumbent, *, seed: int) -> None:
        """Offer joint orders to the incumbent until it is `over` or there is no more to do."""
        ...
