"""What a planner for one head is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:  # options know planners, and load no compiler
    from decmcts.search.sequence.incumbent import Incumbent


@runtime_checkable
class Planner(Protocol):
    """A way to find a good sequence."""

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        """Offer sequences to the incumbent until it is `over` or there is no more to do."""
        ...
