"""What a planner for one head is."""

from __future__ import annotations

from typing import Protocol

from decmcts.search.sequence.incumbent import Incumbent


class Planner(Protocol):
    """A way to find a good sequence."""

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        """Offer sequences to the incumbent until it is `over` or there is no more to do."""
        ...
