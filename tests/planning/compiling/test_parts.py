"""Parts are complete once they were said to be, for every process of this machine."""

from __future__ import annotations

from pathlib import Path

from decmcts.planning.compiling import parts
from decmcts.planning.options import Freedom, Objective, Search
from decmcts.search.sequence.incumbent import Incumbent

PART = "slicer for travel"  # needs next to nothing


def test_a_part_is_complete_once_it_was_said(fresh: Path) -> None:
    """What was compiled before is not compiled again, also by another process."""
    assert not parts.is_compiled(PART)
    parts.mark_compiled(PART)
    assert parts.is_compiled(PART)


def test_of_a_planner_of_one_s_own_nothing_is_compiled_ahead() -> None:
    """What it needs is its own business; the bound and the judge are needed all the same."""

    class Mine:
        def plan(self, incumbent: Incumbent, *, seed: int) -> None:
            return

    mine = parts.parts_for(Search(planner=Mine()), Freedom.REVERSIBLE)
    assert mine == [parts.bound_part("travel"), parts.PRINT]
    timed = Search(objective=Objective.TIME)
    assert parts.parts_for(timed, Freedom.SEAM)[0] == "local for time, seams free"
    walls = parts.parts_for(Search(), Freedom.SEAM, walls=True)
    assert walls[0] == "local for time, seams free"
