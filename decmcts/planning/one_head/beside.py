"""A search that begins before the source's own order is judged.

This is done only where schedule, judge and writer must still be compiled: another process
compiles what the first search needs, and is done sooner. The search runs in a thread, for
kernels run without the interpreter's lock. The judge stays in the main thread, where signals
arrive. If it refuses the source's own order, the search's result is dropped. See
docs/adr/0007-compiled-at-first-use.md.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace

from decmcts.jit.kernel import compiled_first, giving_way
from decmcts.planning.events import Report, Step
from decmcts.planning.one_head.order_search import OrderSearch
from decmcts.search.planners import SearchResult
from decmcts.search.sequence.stopping import Stopping

POLL_S = 0.05  # how often it is asked whether a search can begin
STILL = "the source's own order, judged before anything is written"


@contextmanager
def searched_beside(
    order: OrderSearch, *, stopping: Stopping, report: Report
) -> Iterator[Callable[[], SearchResult | None]]:
    """Search in a thread beside the body of a `with`, from when `order` is ready.

    Yields a function that waits for the search and returns its result, or None if the search
    had not begun when the function was called. If the body raises, the search ends.
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
