"""Ctrl-C, SIGTERM and SIGHUP mean the same: keep the best so far; again: end at once.

Where there is no result to keep, the first one ends the program. Its exit code
is 128 + the signal's number: 130, 143, 129.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any, NoReturn

Handler = Callable[[int, FrameType | None], Any] | int | None
SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
STOPPING = "\ndecmcts: stopping, the best so far is written; {again} again writes nothing more\n"


class Stopped(KeyboardInterrupt):
    """A signal that ends the program.

    A class of its own: `python -m` ends by SIGINT, whatever exit code is asked for, once
    a bare KeyboardInterrupt has passed through an `exec`, and importing dataclasses is
    full of them. Each is kept to the program's end, and with it what was at work when it
    came: objects of LLVM, half handed over, must not be freed by two owners.
    """


_asked = threading.Event()  # to stop, by any signal since `forget`
_finished = threading.Event()  # everything asked for is written
_numbers: list[int] = []  # of the signals that came
_raised: list[Stopped] = []  # kept: see `Stopped`


def end_on_signals() -> None:
    """Let every signal end the program in order: folders removed, children stopped."""

    def on_signal(number: int, _frame: FrameType | None) -> None:
        _numbers.append(number)
        if not _finished.is_set():
            _end()

    _handle(on_signal)


def ignore_signals() -> None:
    """Let nothing change the exit code any more."""
    _handle(signal.SIG_IGN)


def finish() -> None:
    """Everything asked for is written: signals change nothing any more."""
    _finished.set()


def exit_code() -> int:
    """Return the code of a program that a signal ended."""
    return 128 + int(_numbers[-1] if _numbers else signal.SIGINT)


def is_ending() -> bool:
    """Tell whether a signal has ended what ran: what fails from then on fails by it."""
    return bool(_raised)


def end_if_lost() -> None:
    """End the program after all where a signal did, and what it raised was lost on its way.

    Python drops what is raised while it frees objects or in a callback of C code.
    """
    if _raised and threading.current_thread() is threading.main_thread():
        _end()


def forget() -> None:
    """Begin anew, with no signal heard."""
    _asked.clear()
    _finished.clear()
    _numbers.clear()
    _raised.clear()


@contextlib.contextmanager
def interrupt_stops(
    nothing_to_keep: Callable[[], bool] = lambda: False,
) -> Iterator[Callable[[], bool]]:
    """Let the first signal end the search, not the program; yields `stop()`.

    The second one ends the program, also where another `with` is by then at work; and the
    first does while there is `nothing_to_keep`.
    """

    def on_signal(number: int, _frame: FrameType | None) -> None:
        _numbers.append(number)
        if _finished.is_set():
            return
        if _asked.is_set() or nothing_to_keep():
            _end()
        _asked.set()
        again = "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name
        with contextlib.suppress(OSError):  # a handler may not wait for the console's lock
            os.write(2, STOPPING.format(again=again).encode())

    if threading.current_thread() is not threading.main_thread():
        yield _asked.is_set
        return
    previous = _handle(on_signal)
    try:
        yield _asked.is_set
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


def _end() -> NoReturn:
    """End the program, in order."""
    _raised.append(Stopped())
    raise _raised[-1]


def _handle(handler: Handler) -> dict[int, Handler]:
    """Set the handler of all signals; returns what there was.

    A signal that whoever started the program had ignored (`nohup`) stays ignored, but
    for Ctrl-C: shells ignore it for what they run in the background.
    """
    previous: dict[int, Handler] = {}
    for number in SIGNALS:
        if number == signal.SIGINT or signal.getsignal(number) != signal.SIG_IGN:
            previous[number] = signal.signal(number, handler)
    return previous
