"""What a person sees on the terminal while a command works, and the console it is shown on.

Everything goes to standard error except what was asked for (`--json`, tables),
so that output can be piped. A terminal gets one line that changes, everything
else (a log, a slicer's window, `TERM=dumb`) a line a step.

Nothing that comes out of a file commands the terminal. Names of machines and heads, macros, lines
of G-code and recordings hold what somebody else wrote: an escape sequence in them could rename the
window, hide a warning, or answer in the user's place. All that is shown is rendered by a
`SafeConsole`, which puts a question mark in the place of each control character; colours and cursor
movements of our own are not text and pass.
"""

from __future__ import annotations

import json
import math
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any

import numpy as np
from rich.console import Console, ConsoleOptions, RenderableType
from rich.live import Live
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.segment import Segment
from rich.table import Table

from decmcts.cli import signals
from decmcts.formats.files.names import harmless
from decmcts.planning.events import Begun, Event, Heads, Note, Report, Sound, Step, Stop
from decmcts.planning.events import Progress as Searched
from decmcts.print.figures import clock_time
from decmcts.search.bounds.certificate import INFORMS_PERCENT

__all__ = ["SafeConsole", "harmless"]


class SafeConsole(Console):
    """A console that shows no control character of what it is given."""

    def show(self, *lines: str | None) -> None:
        """Print lines whole, however long; those that are empty, or None, not at all."""
        for line in filter(None, lines):
            self.print(line, soft_wrap=True)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Render as any console, what is text without controls."""
        for segment in super().render(renderable, options):
            if segment.control is None and (clean := harmless(segment.text)) != segment.text:
                yield Segment(clean, segment.style)
            else:
                yield segment


err = SafeConsole(stderr=True, highlight=False, markup=False, emoji=False)  # names hold brackets
out = SafeConsole(highlight=False, markup=False, emoji=False)
LINE_EVERY_S = 5.0  # of a search, where lines stay


@contextmanager
def steps(
    *,
    time_limit_s: float = 0.0,
    unit: str = "mm",
    table: Callable[[Heads], Table] | None = None,
    logged: bool = True,
) -> Iterator[Report]:
    """Show what is done, with a spinner; yields the report to make events to.

    While agents are heard of, what `table` makes of them is shown in its place. Where lines stay
    (a log), steps are only `logged` if asked for; notes always are.
    """
    with ExitStack() as shown:
        yield _Display(shown, time_limit_s, unit, table, logged).report


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
        signals.interrupt_stops(lambda: not begun.is_set()) as stop,
        steps(time_limit_s=time_limit_s, unit=unit, table=table, logged=logged) as show,
    ):

        def report(event: Event) -> None:
            signals.end_if_lost()
            if isinstance(event, Begun):
                begun.set()
            elif isinstance(event, Sound):
                if remark:
                    err.show(remark)
            else:
                show(event)

        yield report, stop


class _Display:
    """What is on the terminal: a line that changes, lines that stay, or the table of heads."""

    def __init__(
        self,
        shown: ExitStack,
        time_limit_s: float,
        unit: str,
        table: Callable[[Heads], Table] | None,
        logged: bool,
    ) -> None:
        self._shown, self._limit_s, self._unit, self._table = shown, time_limit_s, unit, table
        self._live = err.is_terminal and not err.is_dumb_terminal
        self._logs = logged and not self._live
        self._logged_at_s = 0.0
        self._begin_line()

    def report(self, event: Event) -> None:
        """Show an event."""
        if isinstance(event, Step):
            self._step(event)
        elif isinstance(event, Note):
            err.show(event.text)
        elif isinstance(event, Searched):
            self._searched(event)
        elif isinstance(event, Heads) and self._table is not None:
            self._heads_stand(event, self._table(event))

    def _begin_line(self) -> None:
        columns = (
            SpinnerColumn("dots" if err.encoding.startswith("utf") else "line"),
            TextColumn("{task.description}"),
            BarColumn(bar_width=24),
            TimeElapsedColumn(),
        )
        self._heads: Live | None = None
        self._line = self._shown.enter_context(
            Progress(*columns, console=err, transient=True, disable=not self._live)
        )
        self._task = self._line.add_task("starting", total=None)

    def _step(self, step: Step) -> None:
        text = f"{step.text} ({step.number} of {step.of})" if step.of else step.text
        if self._heads is not None:
            self._shown.close()
            self._begin_line()
        self._line.update(
            self._task, description=text, total=step.of or None, completed=max(0, step.number - 1)
        )
        if self._logs:
            err.show(text)

    def _heads_stand(self, heads: Heads, table: Table) -> None:
        if self._heads is None:
            self._shown.close()  # one live display at a time
            self._heads = self._shown.enter_context(Live(console=err, transient=True))
        self._heads.update(table)
        at_s = max((agent.elapsed_s for agent in heads.agents), default=0.0)
        if self._logs and at_s >= self._logged_at_s + LINE_EVERY_S:
            self._logged_at_s = at_s
            err.show(heads_line(heads, at_s, self._limit_s))

    def _searched(self, state: Searched) -> None:
        # another search began where seconds fall
        self._logged_at_s = self._logged_at_s if state.seconds >= self._logged_at_s else 0.0
        found = f"{amount(state.cost, self._unit)}{above(state)}"
        self._line.update(
            self._task,
            total=self._limit_s,
            completed=min(state.seconds, self._limit_s),
            description=f"searching: {found}",
        )
        if self._logs and state.seconds >= self._logged_at_s + LINE_EVERY_S:
            self._logged_at_s = state.seconds
            of = f" of {self._limit_s:g}" if state.seconds <= self._limit_s else ""
            err.show(f"{state.seconds:.0f}{of} s: {found}")


@contextmanager
def written() -> Iterator[None]:
    """Say what was done, when it is done: what fails or comes in here changes no exit code."""
    signals.finish()
    try:
        yield
    except Exception as error:
        what = " ".join(f"{type(error).__name__}: {error}".split())
        err.show(f"decmcts: what was asked for is written, but not how it went ({what})")


def above(state: Searched) -> str:
    """Return how far from optimal a search is at most, as words; nothing if that tells nothing."""
    if state.bound is None or state.bound <= 0.0:
        return ""
    gap = 100.0 * (state.cost / state.bound - 1.0)
    return f" ≥ {state.bound:,.0f}, at most {gap:.0f} % above" if gap <= INFORMS_PERCENT else ""


def heads_line(heads: Heads, at_s: float, limit_s: float) -> str:
    """Return where the heads' search stands, for a log."""
    best_s = min(agent.best_makespan_s for agent in heads.agents)
    found = f"print time {clock_time(best_s)}" if math.isfinite(best_s) else "no joint plan yet"
    above = (
        f", {100.0 * (best_s / heads.bound_s - 1.0):.0f} % above the bound"
        if heads.bound_s > 0.0 and math.isfinite(best_s)
        else ""
    )
    of = f" of {limit_s:g}" if at_s <= limit_s else ""  # and then they agree
    return f"heads search, {at_s:.0f}{of} s: {found}{above}"


def amount(cost: float, unit: str) -> str:
    """Return what a search minimises as words: a travel in mm, times in s, or bare costs ("")."""
    if unit == "":
        return f"cost {cost:,.10g}"
    return f"travels {cost:,.1f} s" if unit == "s" else f"travel {cost:,.0f} mm"


def print_json(schema: str, summary: dict[str, Any]) -> None:
    """Print a summary for programs on standard output; docs/json-output.md has the schemas."""
    finite = finite_only({"schema": schema, **summary})
    sys.stdout.write(json.dumps(finite, indent=2, allow_nan=False, default=float) + "\n")


def finite_only(value: Any) -> Any:
    """Return a value with null for every number JSON has no word for."""
    if isinstance(value, Mapping):
        return {key: finite_only(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [finite_only(part) for part in value]
    if isinstance(value, float | np.floating) and not math.isfinite(value):
        return None
    return value
