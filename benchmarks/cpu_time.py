"""`decmcts ARGUMENTS`, the search timed by the work it gets done, not by the clock on the wall.

    python benchmarks/cpu_time.py plan part.gcode --time-limit 60
    DECMCTS_TARGET=782 python benchmarks/cpu_time.py launch yard.qcsp  # ends once it is reached

Machines for rent are shared: seconds on the wall in which a neighbour had the
processor would be lost to one planner and not to the next. Here a search's seconds
are the processor time of the main thread and of its busiest thread, and half of what
threads outside Python took (two work there). Threads that wait for each other are
not charged for the waiting, which is nearly nothing in most of a search.
"""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path

from decmcts.cli import main
from decmcts.planning.bare import solve_qcsp
from decmcts.search.planners import plan_order
from decmcts.search.sop.solver import search_sop
from decmcts.team.qcsp.solver import search_qcsp

TARGET = "DECMCTS_TARGET"  # a makespan of cranes that is good enough


class WorkClock:
    """Seconds of processor time as a search on undisturbed cores would see them pass."""

    def __init__(self) -> None:
        self._main = threading.main_thread().native_id
        self._by_thread: dict[int, float] = {}  # by thread
        self._past = self._ended = 0.0  # of threads that ended: charged, and all
        self._lock = threading.Lock()

    def __call__(self) -> float:
        """Return the seconds so far; only differences matter."""
        with self._lock:
            return self._seconds()

    def _seconds(self) -> float:
        own = _cpu_seconds(self._main)
        if own is None:
            raise OSError("processor time of threads: needs Linux's /proc with schedstat")
        alive = {thread.native_id for thread in threading.enumerate()}
        ended = [self._by_thread.pop(thread) for thread in set(self._by_thread) - alive]
        self._past += max(ended, default=0.0)
        self._ended += sum(ended)
        for thread in alive - {self._main, None}:
            seconds = _cpu_seconds(thread)
            if thread is not None and seconds is not None:
                self._by_thread[thread] = seconds
        busy = list(self._by_thread.values())
        outside = max(0.0, time.process_time() - own - sum(busy) - self._ended)
        return own + self._past + max(busy, default=0.0) + outside / 2


def _cpu_seconds(thread: int | None) -> float | None:
    """Return the processor time of a thread, None if it has ended (Linux only)."""
    try:
        told = Path(f"/proc/self/task/{thread}/schedstat").read_text()
    except OSError:
        return None
    return int(told.split()[0]) / 1e9


def use_work_clock() -> None:
    """Time the next search of this process by its work."""
    for search in (plan_order, search_sop, search_qcsp):
        assert search.__kwdefaults__ is not None
        search.__kwdefaults__["clock"] = WorkClock()
    if TARGET in os.environ:
        assert solve_qcsp.__kwdefaults__ is not None
        solve_qcsp.__kwdefaults__["target"] = float(os.environ[TARGET])


if __name__ == "__main__":
    use_work_clock()
    main()
