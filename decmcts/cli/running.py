"""A run as a person sees it: what it reports is shown, and signals stop it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.table import Table

from decmcts.cli.console import err, steps
from decmcts.cli.signals import end_if_lost, interrupt_stops
from decmcts.planning.events import Begun, Event, Heads, Report, Sound, Stop


@contextmanager
def running(
    *,
    time_limit_s: float,
    unit: str = "mm",
    remark: str = "",
    table: Callable[[Heads], Table] | None = None,
    logged: bool = True,
) -> Iterator[tuple[Report, Stop]]:
    """Show a run and stop it by the first signal once it has begun to search, else end it.

    The `remark` is made once the input is known to be of use; `logged` as in `steps`.
    """
    begun = threading.Event()
    with (
        interrupt_stops(lambda: not begun.is_set()) as stop,
        steps(time_limit_s=time_limit_s, unit=unit, table=table, logged=logged) as show,
    ):

        def report(event: Event) -> None:
            end_if_lost()
            if isinstance(event, Begun):
                begun.set()
            elif isinstance(event, Sound):
                if remark:
                    err.show(remark)
            else:
                show(event)

        yield report, stop
