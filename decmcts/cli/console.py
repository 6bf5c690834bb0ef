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
from contextlib import contextmanager
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from decmcts.cli import signals
from decmcts.search.bounds.certificate import INFORMS_PERCENT

err = Console(stderr=True, highlight=False, markup=False, emoji=False)  # names hold brackets
out = Console(highlight=False, markup=False, emoji=False)
LINE_EVERY_S = 5.0  # of a search, where lines stay


@contextmanager
def steps(
    *, time_limit_s: float = 0.0, unit: str = "mm"
) -> Iterator[tuple[Callable[[str], None], Callable[[Any], None]]]:
    """Show the current step with a spinner; yields (announce, search progress) callbacks."""
    columns = (
        SpinnerColumn("dots" if err.encoding.startswith("utf") else "line"),
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        TimeElapsedColumn(),
    )
    live = err.is_terminal and not err.is_dumb_terminal
    said_at_s = 0.0
    with Progress(*columns, console=err, transient=True, disable=not live) as progress:
        task = progress.add_task("starting", total=None)

        def announce(step: str) -> None:
            progress.update(task, description=step, total=None)
            if not live:
                err.print(step, soft_wrap=True, markup=False)

        def searched(state: Any) -> None:
            nonlocal said_at_s
            said_at_s = said_at_s if state.seconds >= said_at_s else 0.0  # another search began
            found = f"{amount(state.cost, unit)}{above(state)}"
            progress.update(
                task,
                total=time_limit_s,
                completed=min(state.seconds, time_limit_s),
                description=f"searching: {found}",
            )
            if not live and state.seconds >= said_at_s + LINE_EVERY_S:
                said_at_s = state.seconds
                of = f" of {time_limit_s:g}" if state.seconds <= time_limit_s else ""
                err.print(f"{state.seconds:.0f}{of} s: {found}", soft_wrap=True, markup=False)

        yield announce, searched


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


def above(state: Any) -> str:
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


def rows_of(before: dict[str, Any], after: dict[str, Any]) -> list[tuple[str, str, str, int]]:
    """Return the rows both results have a figure for."""
    return [row for row in ROWS if before.get(row[1]) is not None and after.get(row[1]) is not None]


def summary_of(before: dict[str, Any], after: dict[str, Any]) -> dict[str, Any]:
    """Return the figures of a result against its source, for tables and `--json`."""
    rows = {}
    for _, key, _, _ in rows_of(before, after):
        was, now = before[key], after[key]
        gain = 100.0 * (was - now) / was if was else 0.0
        rows[key] = {"before": was, "after": now, "less_percent": round(gain, 3)}
    return rows


def gain_table(before: dict[str, Any], after: dict[str, Any]) -> Table:
    """Return the table of what was gained."""
    table = Table()
    for name, justify in (("", "left"), ("before", "right"), ("after", "right"), ("less", "right")):
        table.add_column(name, justify=justify)  # type: ignore[arg-type]  # a literal of rich's
    for label, key, unit, digits in rows_of(before, after):
        was, now = before[key], after[key]
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
