"""Ctrl-C, SIGTERM and SIGHUP: the best so far is kept, a second one ends at once."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import weakref
from collections.abc import Iterator
from pathlib import Path

import pytest

from decmcts.cli import signals
from decmcts.cli.console import running, written
from decmcts.cli.run import run
from decmcts.cli.signals import interrupt_stops
from decmcts.planning.events import Step

ALL = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]


@pytest.fixture(autouse=True)
def hangup_counts():
    """Undo what `nohup` did to this process: a signal it ignores stays ignored, here and below."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.fixture(autouse=True)
def nothing_heard() -> Iterator[None]:
    """Begin and end without a signal."""
    signals.forget()
    yield
    signals.forget()


@pytest.mark.parametrize("number", ALL)
def test_the_first_asks_and_the_second_ends(number: signal.Signals, capfd) -> None:
    """Whoever stops a search wants its result; whoever does so twice wants out."""
    with interrupt_stops() as stop:
        assert not stop()
        os.kill(os.getpid(), number)
        assert stop()
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), number)
    assert "again writes nothing more" in capfd.readouterr().err
    assert signals.exit_code() == 128 + number


def test_the_second_ends_whatever_comes_after_the_search(capfd) -> None:
    """Writing has a `with` of its own; it must not take the second signal for a first."""
    with interrupt_stops():
        os.kill(os.getpid(), signal.SIGTERM)
    with interrupt_stops() as stop:
        assert stop()
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGTERM)
    assert "SIGTERM again" in capfd.readouterr().err


def test_nothing_ends_a_run_that_is_done(capsys) -> None:
    """With the file in its place, only the summary is left: no signal or fault undoes it."""
    with interrupt_stops(), written():
        os.kill(os.getpid(), signal.SIGTERM)
        os.kill(os.getpid(), signal.SIGTERM)
        raise ValueError("no such\nkey")
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert "is written" in said[0] and "no such key" in said[0]


def test_handlers_are_put_back() -> None:
    """A library that calls us keeps its own handling."""
    before = [signal.getsignal(number) for number in ALL]
    with interrupt_stops():
        assert [signal.getsignal(number) for number in ALL] != before
    assert [signal.getsignal(number) for number in ALL] == before


def test_a_hang_up_that_is_ignored_stays_ignored() -> None:
    """`nohup` means to go on."""
    previous = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with interrupt_stops() as stop:
            os.kill(os.getpid(), signal.SIGHUP)
            assert not stop()
    finally:
        signal.signal(signal.SIGHUP, previous)


@pytest.mark.parametrize("number", ALL)
def test_the_exit_code_names_the_signal(number: signal.Signals) -> None:
    """Where there was no result, scripts see what ended the program; folders are removed."""
    code = (
        "import os, sys, tempfile; from decmcts.cli import signals; signals.end_on_signals()\n"
        "try:\n"
        "    with tempfile.TemporaryDirectory() as folder:\n"
        f"        os.kill(os.getpid(), {int(number)})\n"
        "except KeyboardInterrupt:\n"
        "    sys.exit(signals.exit_code() if not os.path.exists(folder) else 1)\n"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False)
    assert ended.returncode == 128 + number


@pytest.mark.parametrize("number", ALL)
def test_a_signal_while_modules_are_made_ends_with_its_own_code(
    number: signal.Signals, tmp_path: Path
) -> None:
    """Dataclasses are made by `exec`: a bare KeyboardInterrupt in one ended `python -m` as if
    by Ctrl-C, whatever code was asked for."""
    (tmp_path / "stopped.py").write_text(
        "import sys; from decmcts.cli import signals; signals.end_on_signals()\n"
        "try:\n"
        f"    exec('import os; os.kill(os.getpid(), {int(number)})')\n"
        "except KeyboardInterrupt:\n"
        "    sys.exit(signals.exit_code())\n"
    )
    paths = os.pathsep.join([str(tmp_path), *sys.path])
    ended = subprocess.run(
        [sys.executable, "-m", "stopped"], env={**os.environ, "PYTHONPATH": paths},
        capture_output=True, check=False,
    )  # fmt: skip
    assert ended.returncode == 128 + number


def test_what_a_signal_came_into_lives_to_the_end() -> None:
    """Half-made machine code that two owners free ended a stopped run by a fault of memory."""

    class HalfMade:
        pass

    def at_work() -> weakref.ref[HalfMade]:
        made = HalfMade()
        known = weakref.ref(made)
        with interrupt_stops(), contextlib.suppress(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
            os.kill(os.getpid(), signal.SIGINT)
        return known

    assert at_work()() is not None


def test_an_error_made_of_a_signal_is_that_signal(capsys) -> None:
    """Compiled code may end in "returned a result with an exception set": no error of ours."""

    def interrupted(**_: object) -> None:
        try:
            os.kill(os.getpid(), signal.SIGTERM)
        except KeyboardInterrupt as stop:
            raise SystemError("returned a result with an exception set") from stop

    before = {number: signal.getsignal(number) for number in ALL}
    signals.end_on_signals()
    try:
        assert run(["verify", "plan.json"], program=interrupted) == 143
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    assert "decmcts: stopped" in capsys.readouterr().err


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_signal_that_python_dropped_ends_at_the_next_step() -> None:
    """What is raised while an object is freed is lost; a launch went on for seconds."""

    class Freed:
        def __del__(self) -> None:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(signals.Stopped), running(time_limit_s=1.0) as (report, _):
        freed = Freed()
        del freed
        assert signals.is_ending()
        report(Step("reading"))
    assert signals.exit_code() == 130


AT_WORK = """
import atexit, sys, threading, time
import decmcts.cli, decmcts.cli.run
def command(arguments):
    threading.Thread(target=time.sleep, args=(60,), daemon=True).start()
    atexit.register(print, "folders are gone", flush=True)
    return 2
class Taken:
    def __del__(self): print("the interpreter is taken down", flush=True)
kept = Taken()
decmcts.cli.run.run = command
decmcts.cli.main()
"""


def test_a_thread_at_work_changes_no_exit_code() -> None:
    """What a solver in it does while its library is taken down would: it is not taken down."""
    done = subprocess.run(
        [sys.executable, "-c", AT_WORK], capture_output=True, text=True, check=False, timeout=60
    )
    assert (done.returncode, done.stdout) == (2, "folders are gone\n"), done.stderr
