"""Work that goes on in a thread beside the steps of a launch."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from functools import partial
from queue import SimpleQueue
from typing import Any, TypeVar

from decmcts.jit.kernel import made_by

YIELDING = 10  # niceness of work that is to take only what agents leave
Returned = TypeVar("Returned")


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
    """Do work and set its result."""
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
                _yield_to_others()
                _done(work, found)
        finally:
            asked.put(None)

    threading.Thread(target=run, name="yielding", daemon=True).start()
    while (wanted := asked.get()) is not None:
        wanted()


def _yield_to_others() -> None:
    """Lower the priority of this thread alone, on Linux; elsewhere it would be the process'."""
    if sys.platform == "linux":
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), YIELDING)
