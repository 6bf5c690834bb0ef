"""What a person sees on the terminal: steps, search progress, tables, faults.

Everything goes to standard error except what was asked for (`--json`, tables),
so that output can be piped.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

err = Console(stderr=True, highlight=False, markup=False, emoji=False)  # names hold brackets
out = Console(highlight=False, markup=False, emoji=False)


@contextmanager
def steps(
    *, quiet: bool, time_limit_s: float = 0.0, unit: str = "mm"
) -> Iterator[tuple[Callable[[str], None], Callable[[Any], None]]]:
    """Show the current step with a spinner; yields (announce, search progress) callbacks."""
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        TimeElapsedColumn(),
    )
    live = not quiet and err.is_terminal
    with Progress(*columns, console=err, transient=True, disable=not live) as progress:
        task = progress.add_task("starting", total=None)

        def announce(step: str) -> None:
            progress.update(task, description=step, total=None)
            if not quiet and not live:
                err.print(step, soft_wrap=True, markup=False)

        def searched(state: Any) -> None:
            progress.update(
                task,
                total=time_limit_s,
                completed=min(state.seconds, time_limit_s),
                description=f"searching: {amount(state.cost, unit)}{above(state)}",
            )

        yield announce, searched


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
    """Return how far from optimal a search is at most, as words; nothing if no bound is known."""
    if state.bound is None or state.bound <= 0.0:
        return ""
    return f" ≥ {state.bound:,.0f}, at most {100.0 * (state.cost / state.bound - 1.0):.0f} % above"


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
)


def summary_of(before: dict[str, Any], after: dict[str, Any]) -> dict[str, Any]:
    """Return the figures of a result against its source, for tables and `--json`."""
    rows = {}
    for _, key, _, _ in ROWS:
        was, now = before[key], after[key]
        gain = 100.0 * (was - now) / was if was else 0.0
        rows[key] = {"before": was, "after": now, "less_percent": round(gain, 3)}
    return rows


def gain_table(before: dict[str, Any], after: dict[str, Any], title: str) -> Table:
    """Return the table of what was gained."""
    table = Table(title=title, title_justify="left")
    for name, justify in (("", "left"), ("before", "right"), ("after", "right"), ("less", "right")):
        table.add_column(name, justify=justify)  # type: ignore[arg-type]  # a literal of rich's
    for label, key, unit, digits in ROWS:
        was, now = before[key], after[key]
        gain = f"{100.0 * (was - now) / was:.1f} %" if was and key != "contours" else ""
        table.add_row(label, f"{was:,.{digits}f} {unit}", f"{now:,.{digits}f} {unit}", gain)
    return table


def print_json(summary: dict[str, Any]) -> None:
    """Print a summary for programs on standard output."""
    sys.stdout.write(json.dumps(summary, indent=2, default=float) + "\n")
