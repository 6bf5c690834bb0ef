"""A process beside this one, for work that threads would do in turn: Python holds one lock.

`Apart` starts the process and hands it work; run as a module, this file is that process. Work is
a function of a module, or a `partial` of one, and goes over as a pickle through pipes that only
the two processes hold. The process ends with the body of the `with`, and when its standard input
does: then the one that started it is gone.
"""

from __future__ import annotations

import os
import pickle
import queue
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from importlib import import_module
from types import TracebackType
from typing import IO, Any, BinaryIO, Self

from decmcts.planning.events import Report, Step, unheard
from decmcts.planning.team.beside import begun

Work = Callable[..., Any]
"""A piece of work; takes a keyword `report`."""


LOADS = "decmcts.planning.team.judged"  # what the process loads before there is work


class GoneError(Exception):
    """The process is not there any more, or cannot be handed this work."""


class Apart:
    """A process that does what it is handed, one piece of work after the other."""

    def __init__(self, command: Sequence[str] = (sys.executable, "-m", __name__)) -> None:
        self._process = subprocess.Popen(  # in a session of its own: Ctrl-C reaches us alone
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            start_new_session=True,
        )  # fmt: skip

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End it, whatever it does."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError):  # what was not handed over is lost with it
                if pipe is not None:
                    pipe.close()

    def do(self, work: Work) -> Any:
        """Return what the work returns there, or raise what it raises.

        Raises
        ------
        GoneError
            When this process has to do it itself.
        """
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None and stdout is not None
        try:
            _send(work, stdin)
            found, error = pickle.load(stdout)
        except (OSError, EOFError, pickle.PickleError, AttributeError, TypeError) as gone:
            raise GoneError from gone
        if error is not None:
            raise error
        return found


def shared_out(works: Sequence[tuple[str, Work]], apart: Apart | None, report: Report) -> list[Any]:
    """Do named pieces of work, `apart` from the first on and here from the last; return all.

    Whichever process is free takes the next. What the other cannot do is done here, and all of it
    where there is no other. The first to raise ends all.
    """
    left, found = deque(range(len(works))), dict[int, Any]()

    def elsewhere(process: Apart) -> None:
        with suppress(IndexError):
            while True:
                k = left.popleft()
                try:
                    found[k] = process.do(works[k][1])
                except GoneError:
                    left.append(k)
                    return

    if apart is None:
        return [work(report=report) for _, work in works]
    other = begun(partial(elsewhere, apart))
    while len(found) < len(works):
        try:
            k = left.pop()
        except IndexError:  # the other has what is missing
            missing = min(set(range(len(works))) - found.keys(), default=0)
            report(Step(f"{works[missing][0]}, in a process beside"))
            other.result()
            continue
        found[k] = works[k][1](report=report)
    other.result()
    return [found[k] for k in range(len(works))]


def _send(it: object, pipe: IO[bytes]) -> None:
    pipe.write(pickle.dumps(it, pickle.HIGHEST_PROTOCOL))
    pipe.flush()


def _hear(pipe: BinaryIO, works: queue.SimpleQueue[Work]) -> None:
    """Take work until the pipe ends; then end this process, whatever it does."""
    try:
        while True:
            works.put(pickle.load(pipe))
    finally:
        os._exit(0)


def main() -> None:
    """Do what comes through standard input, send what was found through standard output."""
    import_module(LOADS)
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    works = queue.SimpleQueue[Work]()
    requests = os.fdopen(os.dup(0), "rb")
    threading.Thread(target=_hear, args=(requests, works), daemon=True).start()
    while True:
        work = works.get()
        try:
            answer: tuple[Any, Exception | None] = work(report=unheard), None
        except Exception as error:
            answer = None, error
        _send(answer, answers)


if __name__ == "__main__":
    main()
