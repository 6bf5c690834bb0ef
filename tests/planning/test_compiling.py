"""What compiles beside a run must never disturb it."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

from decmcts.planning import compiling
from decmcts.planning.events import Event, Step, unheard
from decmcts.planning.options import Freedom, Objective, Search
from decmcts.search.sequence.incumbent import Incumbent

PART = "slicer for travel"  # needs next to nothing


class Starter:
    """Starts what compiles, and keeps the processes it started."""

    def __init__(self) -> None:
        self.children: list[subprocess.Popen[bytes]] = []

    def __call__(self, parts: Sequence[str]) -> subprocess.Popen[bytes]:
        self.children.append(compiling.start_compiling(parts))
        return self.children[-1]


def test_child_ends_with_the_body(fresh: Path) -> None:
    """A finished program leaves no process behind, even when its body fails."""
    start = Starter()
    with pytest.raises(ZeroDivisionError), compiling.compiling_beside([PART], unheard, start=start):
        assert compiling.compiled_beside(PART)
        raise ZeroDivisionError
    assert [one.poll() is not None for one in start.children] == [True]
    assert not compiling.compiled_beside(PART)


def test_what_is_compiled_beside_may_change(fresh: Path) -> None:
    """Which price a search has is known once its source was read; the other is not needed."""
    other, start = "slicer for time", Starter()
    with compiling.compiling_beside([PART], unheard, start=start):
        with compiling.compiling_beside([other], unheard, start=start):
            assert compiling.compiled_beside(other)
            assert not compiling.compiled_beside(PART)
            assert [one.poll() is None for one in start.children] == [False, True]
        assert compiling.compiled_beside(other)
    assert [one.poll() is None for one in start.children] == [False, False]


def test_a_run_may_wait_for_what_is_compiled_beside_it(fresh: Path) -> None:
    """Agents that all begin with a part missing would each load the compiler for it."""
    told: list[Event] = []
    with compiling.compiling_beside([PART], unheard):
        compiling.finish_beside(PART, told.append)
        assert compiling.is_compiled(PART)
    assert isinstance(told[0], Step)
    assert told[0].text.startswith(f"compiling {PART}, once on this machine")


def test_a_child_that_dies_is_not_waited_for(fresh: Path) -> None:
    """What it would have compiled is then compiled where it is needed."""
    start = Starter()
    with compiling.compiling_beside([PART], unheard, start=start):
        start.children[-1].kill()
        compiling.finish_beside(PART, unheard)
    assert not compiling.is_compiled(PART)


def test_each_part_is_named_once_when_it_is_done(fresh: Path) -> None:
    """Two processes compile them, of which each may come to a part that the other has."""
    other = "slicer for time"
    assert sorted(compiling.made([PART, other])) == sorted([PART, other])
    assert list(compiling.made([])) == []


def test_nothing_is_started_when_all_is_compiled(fresh: Path) -> None:
    """A second process costs a second of start-up each time."""
    compiling.mark_compiled(PART)
    start = Starter()
    with compiling.compiling_beside([PART], unheard, start=start):
        assert not compiling.compiled_beside(PART)
    assert not start.children


def test_a_part_is_complete_once_it_was_said(fresh: Path) -> None:
    """What was compiled before is not compiled again, also by another process."""
    assert not compiling.is_compiled(PART)
    compiling.mark_compiled(PART)
    assert compiling.is_compiled(PART)


def test_of_a_planner_of_one_s_own_nothing_is_compiled_ahead() -> None:
    """What it needs is its own business; the bound and the judge are needed all the same."""

    class Mine:
        def plan(self, incumbent: Incumbent, *, seed: int) -> None:
            return

    mine = compiling.parts_for(Search(planner=Mine()), Freedom.REVERSIBLE)
    assert mine == [compiling.bound_part("travel"), compiling.PRINT]
    timed = Search(objective=Objective.TIME)
    assert compiling.parts_for(timed, Freedom.SEAM)[0] == "local for time, seams free"
    walls = compiling.parts_for(Search(), Freedom.SEAM, walls=True)
    assert walls[0] == "local for time, seams free"
