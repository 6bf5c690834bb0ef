"""A planner that begins with another one, until what it needs itself is ready.

On a computer where nothing is compiled yet the search begins with a planner that needs
few kernels. When the kernels of the other planner are there, that one goes on from the
best sequence with the time that is left. Phases of it whose share of the
time has passed by then are left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.planner import Planner


@dataclass(frozen=True, slots=True)
class Meanwhile:
    """Let `first` search until `ready`, then `then`."""

    first: Planner
    then: Planner
    ready: Callable[[], bool]

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        """Spend the budget."""
        if not self.ready():
            with incumbent.ending_when(self.ready):
                self.first.plan(incumbent, seed=seed)
            if incumbent.over or not self.ready():
                return
        self.then.plan(incumbent, seed=seed)
