"""What a person sees on the terminal: steps, search progress, tables, faults.

Everything goes to standard error except what was asked for (`--json`, tables),
so that output can be piped. A terminal gets one line that changes, everything
else (a log, a slicer's window, `TERM=dumb`) a line a step.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any

import numpy as np
from rich.live import Live
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from decmcts.cli import signals
from decmcts.cli.terminal import SafeConsole
from decmcts.planning.events import Event, Heads, Note, Report, Step
from decmcts.planning.events import Progress as Searched
from decmcts.print.metrics import Metrics, compared_order
from decmcts.search.bounds.certificate import INFORMS_PERCENT

err = SafeConsole(stderr=True, highlight=False, markup=False, emoji=False)  # names hold brackets
out = SafeConsole(highlight=False, markup=False, emoji=False)
LINE_EVERY_S = 5.0  # of a search, where lines stay


@contextmanager
def steps(
    *,
    time_limit_s: float = 0.0,
    unit: str = "mm",
    table: Callable[[Heads], Table] | None = None,
) -> Iterator[Report]:
    """Show what is done, with a spinner; yields the report to make events to.

    While agents are heard of, what `table` makes of them is shown in its place.
    """
    with ExitStack() as shown:
        yield _Display(shown, time_limit_s, unit, table).report


class _Display:
    """What is on the terminal: a line that changes, lines that stay, or the table of heads."""

    def __init__(
        self,
        shown: ExitStack,
        time_limit_s: float,
        unit: str,
        table: Callable[[Heads], Table] | None,
    ) -> None:
        self._shown, self._limit_s, self._unit, self._table = shown, time_limit_s, unit, table
        self._live = err.is_terminal and not err.is_dumb_terminal
        self._said_at_s = 0.0
        self._begin_line()

    def report(self, event: Event) -> None:
        """Show an event."""
        if isinstance(event, Step):
            self._step(event.text)
        elif isinstance(event, Note):
            err.print(event.text, soft_wrap=True)
        elif isinstance(event, Searched):
            self._searched(event)
        elif isinstance(event, Heads) and self._table is not None:
            self._heads_stand(self._table(event))

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

    def _step(self, text: str) -> None:
        if self._heads is not None:
            self._shown.close()
            self._begin_line()
        self._line.update(self._task, description=text, total=None)
        if not self._live:
            err.print(text, soft_wrap=True)

    def _heads_stand(self, table: Table) -> None:
        if self._heads is None:
            self._shown.close()  # one live display at a time
            self._heads = self._shown.enter_context(Live(console=err, transient=True))
        self._heads.update(table)

    def _searched(self, state: Searched) -> None:
        # another search began where seconds fall
        self._said_at_s = self._said_at_s if state.seconds >= self._said_at_s else 0.0
        found = f"{amount(state.cost, self._unit)}{above(state)}"
        self._line.update(
            self._task,
            total=self._limit_s,
            completed=min(state.seconds, self._limit_s),
            description=f"searching: {found}",
        )
        if not self._live and state.seconds >= self._said_at_s + LINE_EVERY_S:
            self._said_at_s = state.seconds
            of = f" of {self._limit_s:g}" if state.seconds <= self._limit_s else ""
            err.print(f"{state.seconds:.0f}{of} s: {found}", soft_wrap=True)


@contextmanager
def written() -> Iterator[None]:
    """Say what was done, when it is done: what fails or comes in here changes no exit code."""
    signals.finish()
    try:
        yield
    except Exception as error:
        what = " ".join(f"{type(error).__name__}: {error}".split())
        err.print(
            f"decmcts: what was asked for is written, but not how it went ({what})", soft_wrap=True
        )


def clock_time(seconds: float) -> str:
    """Return a time as people read it.

    Examples
    --------
    >>> clock_time(3725.4)
    '1 h 02 min 05 s'
    """
    hours, rest = divmod(round(seconds), 3600)
    minutes, left = divmod(rest, 60)
    return f"{hours} h {minutes:02d} min {left:02d} s" if hours else f"{minutes} min {left:02d} s"


def above(state: Searched) -> str:
    """Return how far from optimal a search is at most, as words; nothing if that tells nothing."""
    if state.bound is None or state.bound <= 0.0:
        return ""
    gap = 100.0 * (state.cost / state.bound - 1.0)
    return f" ≥ {state.bound:,.0f}, at most {gap:.0f} % above" if gap <= INFORMS_PERCENT else ""


def amount(cost: float, unit: str) -> str:
    """Return what a search minimises as words: a travel in mm, times in s, or bare costs ("")."""
    if unit == "":
        return f"cost {cost:,.10g}"
    return f"travels {cost:,.1f} s" if unit == "s" else f"travel {cost:,.0f} mm"


ROWS = (
    ("contours", "contours", "", 0),
    ("travel (paper's metric)", "extrusionless_travel_mm", "mm", 1),
    ("emitted travel", "emitted_travel_mm", "mm", 1),
    ("print time", "print_time_s", "s", 1),
    ("print time of whole file", "file_time_s", "s", 1),
    ("retractions", "retractions", "", 0),
    ("travel over outer walls", "travel_over_walls_mm", "mm", 1),
)  # of whole files where one was written; the last where the file names roles
COUNTS = ("contours", "retractions")  # told as they are: 3 → 9 is no loss of 200 %


def compared(before: Metrics, after: Metrics) -> dict[str, tuple[float, float]]:
    """Return the figures of `ROWS` that both results have, before and after."""
    pairs = {key: (before.get(key), after.get(key)) for _, key, _, _ in ROWS}
    return {
        key: (was, now)
        for key, (was, now) in pairs.items()
        if isinstance(was, int | float) and isinstance(now, int | float)
    }


def summary_of(before: Metrics, after: Metrics) -> dict[str, dict[str, float]]:
    """Return the figures of a result against its source, for tables and `--json`."""
    rows = {}
    for key, (was, now) in compared(before, after).items():
        gain = 100.0 * (was - now) / was if was else 0.0
        rows[key] = {"before": was, "after": now, "less_percent": round(gain, 3)}
    return rows


def gain_table(before: Metrics, after: Metrics) -> Table:
    """Return the table of what was gained."""
    table, first = Table(), compared_order(before)
    for name, justify in (("", "left"), (first, "right"), ("after", "right"), ("less", "right")):
        table.add_column(name, justify=justify)  # type: ignore[arg-type]  # a literal of rich's
    figures = compared(before, after)
    for label, key, unit, digits in ROWS:
        if key not in figures:
            continue
        was, now = figures[key]
        gain = f"{100.0 * (was - now) / was:.1f} %" if was and key not in COUNTS else ""
        table.add_row(label, f"{was:,.{digits}f} {unit}", f"{now:,.{digits}f} {unit}", gain)
    return table


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
