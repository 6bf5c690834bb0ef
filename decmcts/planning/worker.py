"""Work beside other work of ours: in a thread, or in a process that takes one call at a time.

Kernels and solvers run without the interpreter's lock, so a thread will do for them. Else Python
runs one thread of a process at a time, and what is to go on beside it needs a process of its own.
It is started ahead, as it takes seconds to load. Calls and results are pickled and go through its
pipes; nothing else can reach them. It ends with its owner, whatever it does at that moment. Where
it can't be started, or is lost, the call is made here.
"""

from __future__ import annotations

import importlib
import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from functools import partial
from queue import SimpleQueue
from typing import IO, Any, TypeVar

from decmcts.jit.kernel import made_by

Returned = TypeVar("Returned")
YIELDING = 10  # niceness of work that is to take only what agents leave
_SIZE = 8  # bytes that say how long a message is


def begun(work: Callable[[], Returned], *, yielding: bool = False) -> Future[Returned]:
    """Begin work in a thread that no exit waits for; kernels and solver run without the lock.

    A `yielding` thread lets all others go first, agents too, on systems where threads have a
    priority of their own. Its kernels are loaded and compiled at the usual priority: others
    wait for the compiler meanwhile.
    """
    found: Future[Returned] = Future()
    target = partial(_yielding, work, found) if yielding else partial(_done, work, found)
    threading.Thread(target=target, name="beside", daemon=True).start()
    return found


def _done(work: Callable[[], Returned], found: Future[Returned]) -> None:
    try:
        found.set_result(work())
    except BaseException as error:
        found.set_exception(error)


def _yielding(work: Callable[[], Returned], found: Future[Returned]) -> None:
    """Have work done in a thread of low priority, and make its kernels in this one."""
    asked: SimpleQueue[Callable[[], None] | None] = SimpleQueue()

    def make(call: Callable[[], Any]) -> Any:
        made: Future[Any] = Future()
        asked.put(partial(_done, call, made))
        return made.result()

    def run() -> None:
        try:
            with made_by(make):
                if sys.platform == "linux":  # elsewhere it would be the priority of the process
                    with suppress(OSError):
                        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), YIELDING)
                _done(work, found)
        finally:
            asked.put(None)

    threading.Thread(target=run, name="yielding", daemon=True).start()
    while (wanted := asked.get()) is not None:
        wanted()


class Worker:
    """A process that makes calls for this one."""

    def __init__(self, process: subprocess.Popen[bytes] | None) -> None:
        self._process = process
        self._over = False
        self._one = threading.Lock()  # call at a time: answers come in their order

    def end(self) -> None:
        """End the process, be it at work or not; nobody waits for its answer."""
        self._over = True
        if self._process is not None:
            self._process.kill()

    def call(self, function: Callable[..., Returned], *given: Any) -> Future[Returned]:
        """Have a function of a module called; its result, or its error, is the future's.

        Where the process is lost, or cannot be handed this, the call is made in this one.
        """
        found: Future[Returned] = Future()
        threading.Thread(
            target=self._called, args=(found, function, given), name="worker", daemon=True
        ).start()
        return found

    def _called(
        self, found: Future[Returned], function: Callable[..., Returned], given: tuple[Any, ...]
    ) -> None:
        """Set the result of a call; made here where no answer comes."""
        process = self._process
        try:
            if process is None or process.stdin is None or process.stdout is None:
                raise EOFError
            with self._one:
                _send(process.stdin, (function, given))
                error, value = _receive(process.stdout)
        except Exception:  # a pipe that ended, or what can't be packed or unpacked: anything
            if self._over:
                found.cancel()
                return
            error, value = _made(function, given)
        if error is not None:
            found.set_exception(error)
        else:
            found.set_result(value)


@contextmanager
def worker(*modules: str) -> Iterator[Worker]:
    """Start a worker for the body of a `with`; it is ended with it, be it at work or not.

    It loads these `modules` before any call comes.
    """
    command = [sys.executable, "-P", "-m", "decmcts.planning.worker", *modules]
    pipe = subprocess.PIPE
    try:
        process = subprocess.Popen(
            command, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL
        )  # fmt: skip
    except OSError:
        yield Worker(None)
        return
    found = Worker(process)
    try:
        yield found
    finally:
        found.end()
        with suppress(OSError), process:  # unsent words of a call that ended early
            pass


def _made(
    function: Callable[..., Returned], given: tuple[Any, ...]
) -> tuple[Exception | None, Returned | None]:
    """Make a call; return its error and its result."""
    try:
        return None, function(*given)
    except Exception as error:
        return error, None


def _send(pipe: IO[bytes], message: Any) -> None:
    packed = pickle.dumps(message, pickle.HIGHEST_PROTOCOL)
    pipe.write(len(packed).to_bytes(_SIZE, "big") + packed)
    pipe.flush()


def _receive(pipe: IO[bytes]) -> Any:
    size = int.from_bytes(_whole(pipe, _SIZE), "big")
    return pickle.loads(_whole(pipe, size))  # from our own process, through a pipe of ours


def _whole(pipe: IO[bytes], size: int) -> bytes:
    found = pipe.read(size)
    if len(found) < size:
        raise EOFError
    return found


def main() -> None:
    """Make the calls that come in, until their sender is gone."""
    with suppress(ValueError):
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the owner decides what Ctrl-C ends
    calls: queue.Queue[tuple[Callable[..., Any], tuple[Any, ...]]] = queue.Queue()
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what is printed on the way is no answer

    def take() -> None:
        while True:
            try:
                calls.put(_receive(sys.stdin.buffer))
            except BaseException:  # its end, or what can't be unpacked: the owner calls there
                os._exit(0)

    threading.Thread(target=take, name="calls", daemon=True).start()
    for module in sys.argv[1:]:
        importlib.import_module(module)
    while True:
        _send(answers, _made(*calls.get()))


if __name__ == "__main__":
    main()
