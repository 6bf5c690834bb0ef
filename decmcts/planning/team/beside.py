"""Work that goes on in a thread beside the steps of a launch."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from typing import TypeVar

YIELDING = 10  # niceness of work that is to take only what agents leave
Found = TypeVar("Found")


def begun(work: Callable[[], Found], *, yielding: bool = False) -> Future[Found]:
    """Begin work in a thread that no exit waits for; kernels and solver run without the lock.

    A `yielding` thread lets all others go first, agents too, on systems where threads have a
    priority of their own.
    """
    found: Future[Found] = Future()

    def run() -> None:
        try:
            if yielding:
                _yield_to_others()
            found.set_result(work())
        except BaseException as error:
            found.set_exception(error)

    threading.Thread(target=run, name="beside", daemon=True).start()
    return found


def _yield_to_others() -> None:
    """Lower the priority of this thread alone, on Linux; elsewhere it would be the process'."""
    if sys.platform == "linux":
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), YIELDING)
