"""A search that begins before the source's own order is judged.

Only where schedule, judge and writer must be compiled for that: what a first search needs
is compiled sooner, by another process. The search runs in a thread, for kernels run
without the interpreter's lock; judging stays in the main thread, where signals arrive.
Nothing that is found counts before the judge is content. See
docs/adr/0007-compiled-at-first-use.md.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from typing import Protocol

from decmcts.jit.kernel import compiled_first, giving_way
from decmcts.planning.events import Report, Step, Stop
from decmcts.search.planners import Planner, SearchResult
from decmcts.search.sequence.stopping import Stopping

POLL_S = 0.05  # how often it is asked whether a search can begin
STILL = "the source's own order, judged before anything is written"


class _Search(Protocol):
    def ready(self) -> bool: ...
    def begin(self, stop: Stop) -> str | Planner: ...
    def search(self, chosen: str | Planner, stopping: Stopping) -> SearchResult: ...


@contextmanager
def searched_beside(
    order: _Search, *, stopping: Stopping, report: Report
) -> Iterator[Callable[[], SearchResult | None]]:
    """Search in a thread beside the body of a `with`, begun as soon as that is ready.

    Yields a function that waits for the result; None where nothing was begun before it was
    called. A body that fails ends the search.
    """
    wanted, failed = threading.Event(), threading.Event()
    until = replace(stopping, asked=lambda: failed.is_set() or stopping.is_asked())

    def run() -> SearchResult | None:
        while not order.ready():
            if wanted.wait(POLL_S) or failed.is_set():
                return None
        with compiled_first():
            chosen = order.begin(until.is_asked)
        found = order.search(chosen, until)
        if not (wanted.is_set() or failed.is_set()):
            report(Step(STILL))
        return found

    def result() -> SearchResult | None:
        wanted.set()
        return future.result()

    with ThreadPoolExecutor(1, thread_name_prefix="search") as pool:
        future = pool.submit(run)
        try:
            with giving_way():
                yield result
        except BaseException:
            failed.set()
            raise
        finally:
            wanted.set()
