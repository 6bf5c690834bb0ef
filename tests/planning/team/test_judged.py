"""What is judged by two processes at once is judged as by one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from decmcts.planning.events import Event, Step, unheard
from decmcts.planning.options import TeamSearch
from decmcts.planning.problem.print_problem import load
from decmcts.planning.team.pipeline import plan_team
from decmcts.planning.worker import Worker, worker
from decmcts.planning.writing.heads import judged, shared_out
from tests.makers.agents import Agents
from tests.prints import four_parts


@pytest.fixture(scope="module")
def beside() -> Iterator[Worker]:
    with worker() as process:
        yield process


def test_each_piece_of_work_is_done_once_and_waited_for_with_a_word(beside: Worker) -> None:
    """A step that takes long is told, whichever process is at it."""
    events: list[Event] = []
    works: list[tuple[str, Any]] = [(name, partial(dict, at=name)) for name in "abc"]
    found = shared_out(works, beside, events.append)
    assert [each["at"] for each in found] == ["a", "b", "c"]
    assert set(events) <= {Step(f"{name}, in a process beside") for name in "abc"}


def test_what_cannot_be_handed_over_is_done_here(beside: Worker) -> None:
    """A writer that a program brings may be any function."""
    works: list[tuple[str, Any]] = [(str(k), lambda k=k, *, report: k) for k in range(3)]
    assert shared_out(works, beside, unheard) == [0, 1, 2]


def test_what_fails_beside_fails_here(beside: Worker) -> None:
    """No result of the others hides it."""
    works: list[tuple[str, Any]] = [
        ("fails", partial(int, "no number")),
        ("works", partial(dict, at=1)),
    ]
    with pytest.raises((ValueError, TypeError)):
        shared_out(works, beside, unheard)


@pytest.mark.slow
def test_files_are_the_same_with_a_worker_and_without(
    beside: Worker, agents: Agents, tmp_path: Path
) -> None:
    """Byte for byte, and so is the verdict."""
    problem = load(four_parts(tmp_path), "dual-gantry")
    planned = plan_team(problem, TeamSearch(0.5), writes=True, agents=agents)
    assert len(planned.head_files) == 2
    bare = replace(planned, head_files=())
    found = judged(bare, beside, writes=True, report=unheard)
    assert found.head_files == planned.head_files
    assert found.verdict.checked == planned.verdict.checked
    assert not judged(bare, beside, writes=False, report=unheard).head_files
