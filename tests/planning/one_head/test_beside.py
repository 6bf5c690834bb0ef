"""Where the judge must be compiled first, the search begins meanwhile; nothing else changes."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
from functools import partial
from pathlib import Path

import pytest

from decmcts.errors import InputError
from decmcts.planning.events import Begun, Sound, Step, unheard
from decmcts.planning.one_head import pipeline
from decmcts.planning.one_head.order_search import STILL, searched_beside
from decmcts.planning.one_head.pipeline import plan_one_head
from decmcts.planning.options import NO_QUALITY, Search
from decmcts.planning.problem.first_check import refuse_unsound, refuse_unwritable
from decmcts.planning.problem.planned import Planned
from decmcts.planning.problem.print_problem import PrintProblem, load
from decmcts.samples import sample_path
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.stopping import Stopping
from tests.planning.problem.test_first_check import LAYERS, one_fault

SOON_S = 60.0  # far more than anything here takes
PRINT = sample_path("four_nuts.gcode.gz")


class Order:
    """A search that lasts until it is told to stop."""

    def __init__(self, *, compiled: bool) -> None:
        self.compiled, self.began, self.stopped = compiled, threading.Event(), False

    def ready(self) -> bool:
        return self.compiled

    def begin(self, stop):
        return "local"

    def search(self, chosen, stopping):
        self.began.set()
        while not stopping.is_asked():
            threading.Event().wait(0.001)
        self.stopped = True
        return chosen


@pytest.fixture
def problem(tmp_path: Path) -> PrintProblem:
    path = tmp_path / "in.gcode"
    path.write_text(LAYERS)
    return load(path, "paper", NO_QUALITY)


def told_written(told: list[str]):
    """Return a judge of the text of the source's own order that says it was asked."""

    def refuse_text(*_given) -> tuple[str, ...]:
        told.append("written")
        return ()

    return refuse_text


class Searching:
    """A planner that says when it begins, and searches until it is stopped or `enough`."""

    def __init__(self, told: list[str], *, enough: bool = True) -> None:
        self.told, self.began, self.enough = told, threading.Event(), enough

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        self.told.append("searched")
        self.began.set()
        while not (self.enough or incumbent.over):
            incumbent.tick()
            threading.Event().wait(0.001)
        self.told.append("ended")


def test_the_search_runs_beside_and_its_result_is_waited_for() -> None:
    """The body judges; what was found meanwhile is what counts."""
    order, asked = Order(compiled=True), threading.Event()
    stopping = Stopping(SOON_S, asked=asked.is_set)
    with searched_beside(order, stopping=stopping, report=unheard) as found:
        assert order.began.wait(SOON_S)
        asked.set()
        assert found() == "local"


def test_nothing_is_begun_that_is_not_compiled() -> None:
    """Compiling in a second thread would only wait for the first; the caller begins then."""
    order = Order(compiled=False)
    with searched_beside(order, stopping=Stopping(SOON_S), report=unheard) as found:
        assert found() is None
    assert not order.began.is_set()


def test_a_body_that_fails_ends_the_search() -> None:
    """A refusal is said at once, not when the time limit of the search is over."""
    order = Order(compiled=True)
    with (
        pytest.raises(ZeroDivisionError),
        searched_beside(order, stopping=Stopping(SOON_S), report=unheard),
    ):
        assert order.began.wait(SOON_S)
        raise ZeroDivisionError
    assert order.stopped


def test_a_search_that_fails_is_heard_of() -> None:
    """A fault in a thread must not pass for a result."""

    class Broken(Order):
        def search(self, chosen, stopping):
            raise RuntimeError("no linear extension")

    with (
        pytest.raises(RuntimeError, match="no linear extension"),
        searched_beside(Broken(compiled=True), stopping=Stopping(SOON_S), report=unheard) as found,
    ):
        found()


def test_the_search_begins_before_the_judge_is_compiled(problem) -> None:
    """What it waits for is its own kernels, and no longer the judge's."""
    told: list[str] = []
    planner, events = Searching(told), []

    def refuse(*given) -> None:
        assert planner.began.wait(SOON_S)
        refuse_unsound(*given)
        told.append("judged")

    plan_one_head(
        problem, Search(60.0, planner=planner), writes=True, report=events.append,
        compiled=lambda part: False, refuse=refuse,
    )  # fmt: skip
    assert told == ["searched", "ended", "judged"]
    said = [event.text for event in events if isinstance(event, Step)]
    assert said.index("the source's own order, judged while the search begins") < said.index(
        "searching (searching, 60 s)"
    )
    assert events.index(Begun()) < events.index(Sound())


def test_what_the_judge_refuses_ends_the_search(problem) -> None:
    """As where it is judged first: nobody waits for a search that is in vain."""
    told: list[str] = []
    planner = Searching(told, enough=False)

    def refuse(*_given) -> None:
        assert planner.began.wait(SOON_S)
        raise InputError("in its own order this print fails verification")

    with pytest.raises(InputError, match="in its own order"):
        plan_one_head(
            problem, Search(600.0, planner=planner), writes=True, compiled=lambda part: False,
            refuse=refuse,
        )  # fmt: skip
    assert told == ["searched", "ended"]


def test_where_all_is_compiled_the_judge_comes_first(problem) -> None:
    """It takes less than a second then, and nothing is searched in vain."""
    told: list[str] = []

    plan_one_head(
        problem, Search(0.2, planner=Searching(told)), writes=True, compiled=lambda part: True,
        refuse=lambda *_: told.append("judged"), refuse_text=told_written(told),
    )  # fmt: skip
    assert told == ["judged", "written", "searched", "ended"]


def test_the_text_of_a_large_print_is_judged_while_the_search_runs(problem, monkeypatch) -> None:
    """It takes as long as many a search; the plan is judged before, and a refusal is heard."""
    monkeypatch.setattr(pipeline, "BESIDE_FROM", len(problem.job.contours))
    told: list[str] = []
    planner = Searching(told)

    def planned(refuse_text) -> Planned:
        return plan_one_head(
            problem, Search(60.0, planner=planner), writes=True, compiled=lambda part: True,
            refuse=lambda *_: told.append("judged"), refuse_text=refuse_text,
        )  # fmt: skip

    planned(refuse_unwritable)
    assert told[:2] == ["judged", "searched"]
    planner.enough = False
    with pytest.raises(InputError, match=r"in.gcode:10: in its own order this print fails"):
        planned(partial(refuse_unwritable, verify=one_fault))
    assert told[-2:] == ["searched", "ended"]


@pytest.mark.slow
@pytest.mark.long  # compiles all anew; above, the same order of steps with nothing compiled
@pytest.mark.skipif(sys.platform == "win32", reason="no signals there")
def test_on_an_empty_cache_a_search_runs_before_all_is_compiled(tmp_path: Path) -> None:
    """It improves the order while the judge is compiled, and Ctrl-C keeps what it found."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    out, said = tmp_path / "out.gcode", []
    command = [sys.executable, "-m", "decmcts.cli", "plan", str(PRINT), "-o", str(out)]
    command += ["--machine", "paper", "--allow-slower", "--time-limit", "600"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment) as child:
        assert child.stderr is not None
        for line in child.stderr:
            said.append(line)
            if " of 600 s: travel" in line:
                child.send_signal(signal.SIGINT)
                break
        said += child.stderr
        assert child.wait(timeout=600) == 0, "".join(said)
    text = "".join(said)
    assert text.index("searching (") < text.index("stopping, the best so far")
    assert text.index("stopping, the best so far") < text.index(STILL)
    found = [float(m.replace(",", "")) for m in re.findall(r"s: travel ([\d,]+) mm", text)]
    assert out.exists() and 0.0 < found[0] < 11_000.0  # 11 572 mm as sliced
