"""The planner `slicer`: the order and directions of the source, to compare with."""

from __future__ import annotations

from dataclasses import dataclass

from decmcts.search.sequence.incumbent import Incumbent


@dataclass(frozen=True, slots=True)
class Slicer:
    """Leaves everything as it was sliced."""

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        """Do nothing: the incumbent starts as the source."""
        incumbent.tick()
