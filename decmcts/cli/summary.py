"""What a result gained, in the maker's words: as a table, as plain lines, and for programs.

Each figure is shown once. The paper's figures are for programs (`--json`) and `--verbose`.
"""

from __future__ import annotations

from dataclasses import dataclass

from rich.table import Table

from decmcts.print.figures import MAKERS, change, shown
from decmcts.print.metrics import Metrics, compared_order

KEYS = (
    "contours",
    "extrusionless_travel_mm",
    "emitted_travel_mm",
    "print_time_s",
    "file_time_s",
    "retractions",
    "tool_changes",
    "travel_over_walls_mm",
)  # of whole files where one was written; the last where the file names roles
COUNTS = ("contours", "retractions", "tool_changes")  # told as they are: 3 → 9 is no loss of 200 %
PAPERS = {
    "contours": "contours",
    "extrusionless_travel_mm": "travel between contours",  # the paper's metric
}


@dataclass(frozen=True, slots=True)
class FigureRow:
    """One figure before and after, as it is shown."""

    label: str
    before: str
    after: str
    change: str  # '' where a share tells nothing


def compared(before: Metrics, after: Metrics) -> dict[str, tuple[float, float]]:
    """Return the figures of `KEYS` that both results have, before and after."""
    pairs = {key: (before.get(key), after.get(key)) for key in KEYS}
    return {
        key: (was, now)
        for key, (was, now) in pairs.items()
        if isinstance(was, int | float) and isinstance(now, int | float)
    }


def summary_of(before: Metrics, after: Metrics) -> dict[str, dict[str, float]]:
    """Return the figures of a result against its source, for `--json`."""
    rows = {}
    for key, (was, now) in compared(before, after).items():
        gain = 100.0 * (was - now) / was if was else 0.0
        rows[key] = {"before": was, "after": now, "less_percent": round(gain, 3)}
    return rows


def rows_of(before: Metrics, after: Metrics, *, verbose: bool = False) -> list[FigureRow]:
    """Return what is shown of a result against its source.

    The print time is the whole file's, where one was written; `verbose` tells the part of it
    from the first bead to the last too.
    """
    figures = compared(before, after)
    whole = "file_time_s" in figures
    labels = {"file_time_s" if whole else "print_time_s": "print time", **MAKERS}
    if verbose:
        labels |= PAPERS
        if whole:
            labels["print_time_s"] = "print time, first to last bead"
    return [_row(label, key, *figures[key]) for key, label in labels.items() if key in figures]


def _row(label: str, key: str, was: float, now: float) -> FigureRow:
    return FigureRow(
        label, shown(key, was), shown(key, now), "" if key in COUNTS else change(was, now)
    )


def gain_table(before: Metrics, after: Metrics, *, verbose: bool = False) -> Table:
    """Return the table of what was gained."""
    table, first = Table(), compared_order(before)
    table.add_column("")
    for name in (first, "after", "change"):
        table.add_column(name, justify="right")
    for row in rows_of(before, after, verbose=verbose):
        table.add_row(row.label, row.before, row.after, row.change)
    return table


def plain_lines(before: Metrics, after: Metrics, *, verbose: bool = False) -> list[str]:
    """Return the same as lines, for a log without columns."""
    of = "" if compared_order(before) == "before" else f" ({compared_order(before)})"
    return [
        f"{row.label}: {row.before}{of} → {row.after}" + (f" ({row.change})" if row.change else "")
        for row in rows_of(before, after, verbose=verbose)
    ]
