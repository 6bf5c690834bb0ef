"""Ctrl-C, SIGTERM and SIGHUP: the best so far is kept, a second one ends at once."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

from decmcts.cli import signals
from decmcts.cli.console import written
from decmcts.cli.signals import interrupt_stops

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
