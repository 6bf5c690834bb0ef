"""Where the judge must be compiled first, the search begins meanwhile; nothing else changes."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from decmcts.cli import app, beside, order_search, plan
from decmcts.cli.beside import STILL, searched_beside
from decmcts.samples import sample_path
from decmcts.search.planners import plan_order
from tests.cli.test_first_check import LAYERS, one_fault

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

    def search(self, chosen, stop):
        self.began.set()
        while not stop():
            threading.Event().wait(0.001)
        self.stopped = True
        return chosen


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "in.gcode"
    path.write_text(LAYERS)
    return path


@pytest.fixture
def told(monkeypatch) -> list[str]:
    """Return what was done in turn: a search begun, the source's order found sound."""
    names: list[str] = []
    judge = plan.refuse_unsound

    def judged(*args, **options):
        judge(*args, **options)
        names.append("judged")

    def searched(*args, **options):
        names.append("searched")
        return plan_order(*args, **options)

    monkeypatch.setattr(plan, "refuse_unsound", judged)
    monkeypatch.setattr(order_search, "plan_order", searched)
    return names


def judge_compiled(monkeypatch, compiled: bool) -> None:
    """Let the judge's part be compiled or not, and what searches need be there."""
    monkeypatch.setattr(plan, "is_compiled", lambda part: compiled)
    monkeypatch.setattr(order_search, "can_begin", lambda problem, planner: True)


def test_the_search_runs_beside_and_its_result_is_waited_for() -> None:
    """The body judges; what was found meanwhile is what counts."""
    order, asked = Order(compiled=True), threading.Event()
    with searched_beside(order, stop=asked.is_set, announce=lambda step: None) as found:
        assert order.began.wait(SOON_S)
        asked.set()
        assert found() == "local"


def test_nothing_is_begun_that_is_not_compiled() -> None:
    """Compiling in a second thread would only wait for the first; the caller begins then."""
    order = Order(compiled=False)
    with searched_beside(order, stop=lambda: False, announce=lambda step: None) as found:
        assert found() is None
    assert not order.began.is_set()


def test_a_body_that_fails_ends_the_search() -> None:
    """A refusal is said at once, not when the time limit of the search is over."""
    order = Order(compiled=True)
    with (
        pytest.raises(ZeroDivisionError),
        searched_beside(order, stop=lambda: False, announce=lambda step: None),
    ):
        assert order.began.wait(SOON_S)
        raise ZeroDivisionError
    assert order.stopped


def test_a_search_that_fails_is_heard_of() -> None:
    """A fault in a thread must not pass for a result."""

    class Broken(Order):
        def search(self, chosen, stop):
            raise RuntimeError("no linear extension")

    with (
        pytest.raises(RuntimeError, match="no linear extension"),
        searched_beside(
            Broken(compiled=True), stop=lambda: False, announce=lambda step: None
        ) as found,
    ):
        found()


def test_a_signal_keeps_what_a_search_found_and_else_ends_at_once(monkeypatch) -> None:
    """While kernels are compiled for the judge there may be a result already, or not yet."""
    order, asked = Order(compiled=False), threading.Event()
    monkeypatch.setattr(beside, "at_work", lambda: False)
    assert not beside.nothing_to_keep()
    monkeypatch.setattr(beside, "at_work", lambda: True)
    assert beside.nothing_to_keep()
    with searched_beside(order, stop=asked.is_set, announce=lambda step: None):
        assert beside.nothing_to_keep()
        order.compiled = True
        assert order.began.wait(SOON_S)
        assert not beside.nothing_to_keep()
        asked.set()
    assert beside.nothing_to_keep()


@pytest.mark.parametrize("command", ["plan", "post"])
def test_the_search_begins_before_the_judge_is_compiled(
    source, tmp_path, capsys, monkeypatch, told, command: str
) -> None:
    """What it waits for is its own kernels, and no longer the judge's."""
    judge_compiled(monkeypatch, False)
    begun, order, judge = threading.Event(), order_search.plan_order, plan.refuse_unsound

    def searched(*args, **options):
        begun.set()
        return order(*args, **options)

    def judged(*args, **options):
        assert begun.wait(SOON_S)
        judge(*args, **options)

    monkeypatch.setattr(order_search, "plan_order", searched)
    monkeypatch.setattr(plan, "refuse_unsound", judged)
    outputs = ["-o", str(tmp_path / "out.gcode")] if command == "plan" else []
    words = [command, str(source), *outputs, "--machine", "paper", "--time-limit", "0.2"]
    assert app.run([*words, "--allow-slower"]) == 0
    assert told[0] == "searched" and "judged" in told
    said = capsys.readouterr().err
    assert said.index("judged while the search begins") < said.index("searching (")


@pytest.mark.parametrize("command", ["plan", "post"])
def test_what_the_judge_refuses_ends_the_search_and_writes_nothing(
    source, tmp_path, capsys, monkeypatch, command: str
) -> None:
    """As where it is judged first: one line, exit code 2, no file."""
    judge_compiled(monkeypatch, False)
    one_fault(monkeypatch)
    begun, stopped, judge = threading.Event(), [], plan.refuse_unsound

    def searched(*args, stopping, **options):
        begun.set()
        while not stopping.asked():
            threading.Event().wait(0.001)
        stopped.append(True)
        return plan_order(*args, stopping=stopping, **options)

    def judged(*args, **options):
        assert begun.wait(SOON_S)
        judge(*args, **options)

    monkeypatch.setattr(order_search, "plan_order", searched)
    monkeypatch.setattr(plan, "refuse_unsound", judged)
    outputs = ["-o", str(tmp_path / "out.gcode")] if command == "plan" else []
    before = source.read_bytes()
    assert (
        app.run([command, str(source), *outputs, "--machine", "paper", "--time-limit", "600"]) == 2
    )
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert f"{source}:10: in its own order this print fails verification with 1 fault" in said
    assert stopped and source.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["in.gcode"]


def test_where_all_is_compiled_the_judge_comes_first(source, monkeypatch, told) -> None:
    """It takes less than a second then, and nothing is searched in vain."""
    judge_compiled(monkeypatch, True)
    assert app.run(["plan", str(source), "--machine", "paper", "--time-limit", "0.2"]) == 0
    assert told[:2] == ["judged", "searched"]


@pytest.mark.slow
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
