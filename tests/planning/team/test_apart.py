"""Work in a process beside this one is done, fails and ends as if it were done here."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from decmcts.errors import InputError
from decmcts.planning.events import Event, Step, unheard
from decmcts.planning.options import TeamSearch
from decmcts.planning.problem.print_problem import load
from decmcts.planning.team.apart import LOADS, Apart, GoneError, shared_out
from decmcts.planning.team.judged import judged
from decmcts.planning.team.pipeline import plan_team
from tests.planning.conftest import Agents
from tests.planning.team.test_pipeline import print_of_parts

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def apart() -> Iterator[Apart]:
    with Apart() as process:
        yield process


def refused(*, report: Any) -> None:
    raise InputError("a move goes nowhere", path="in.gcode", line=3, advice="remove it")


def test_an_error_there_is_an_error_here(apart: Apart) -> None:
    """One line with file, line and advice, and exit code 2: as where nothing is beside."""
    with pytest.raises(InputError) as raised:
        apart.do(refused)
    here = InputError("a move goes nowhere", path="in.gcode", line=3, advice="remove it")
    assert str(raised.value) == str(here)
    assert (raised.value.line, raised.value.advice) == (3, "remove it")


def test_what_cannot_be_handed_over_is_done_here(apart: Apart) -> None:
    """A writer that a test or a program brings may be any function; the process goes on."""
    works: list[tuple[str, Any]] = [(str(k), lambda k=k, *, report: k) for k in range(3)]
    assert shared_out(works, apart, unheard) == [0, 1, 2]
    assert apart.do(partial(dict, at=1))["at"] == 1


def test_what_is_missing_is_waited_for_with_a_word(apart: Apart) -> None:
    """A step that takes long is told, whichever process is at it."""
    events: list[Event] = []
    works = [("the first", partial(dict, at=0)), ("the last", partial(dict, at=1))]
    found = shared_out(works, apart, events.append)
    assert [each["at"] for each in found] == [0, 1]
    assert set(events) <= {Step("the first, in a process beside")}


def test_a_process_that_is_gone_costs_no_result() -> None:
    """It may have been killed for its memory."""
    with Apart() as process:
        process._process.kill()
        with pytest.raises(GoneError):
            process.do(partial(dict, at=1))
        found = shared_out([("it", partial(dict, at=1))], process, unheard)
    assert found == [{"at": 1, "report": unheard}]


def test_it_ends_with_the_one_that_started_it() -> None:
    """No process goes on working for a launcher that was killed, whatever it is at."""
    with Apart() as process:
        assert process.do(partial(dict, at=1))["at"] == 1  # it has loaded
        child = process._process
        assert child.stdin is not None
        child.stdin.write(pickle.dumps(partial(exec, "import time; time.sleep(60)")))
        child.stdin.close()  # as the system does for a process that was killed
        assert child.wait(5.0) == 0


def test_files_are_the_same_with_a_process_beside_and_without(
    apart: Apart, agents: Agents, tmp_path: Path
) -> None:
    """Byte for byte, and so is the verdict."""
    problem = load(Path(print_of_parts(tmp_path)), "dual-gantry")
    planned = plan_team(problem, TeamSearch(0.5), writes=True, agents=agents)
    assert len(planned.head_files) == 2
    bare = replace(planned, head_files=())
    beside = judged(bare, apart, writes=True, report=unheard)
    assert beside.head_files == planned.head_files
    assert beside.verdict.checked == planned.verdict.checked
    assert not judged(bare, apart, writes=False, report=unheard).head_files
    assert judged.__module__ == LOADS
