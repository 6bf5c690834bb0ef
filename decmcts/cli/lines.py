"""What is said of a result, in lines for a person and in figures for a program.

Each figure is shown once, in the maker's words. The paper's figures are for programs (`--json`)
and `--verbose`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from decmcts.planning.one_head.certificate import ROUNDING, Certificate
from decmcts.planning.result import Result
from decmcts.planning.writing.file_times import FileTimes, is_longer
from decmcts.print.figures import MAKERS, change, clock_time, idle_line, shown
from decmcts.print.metrics import CutMetrics, Metrics, compared_order
from decmcts.search.bounds.certificate import INFORMS_PERCENT


def bound_line(
    found: Certificate | None, *, verbose: bool = False, fewer_changes: bool = False
) -> str | None:
    """Return one line on how near to the best a result is; None where there is nothing to say.

    A bound too far away to tell a good order from a quick one is of no use to a person; it is
    in the metrics for programs. The figures themselves are for those who ask. With `fewer_changes`
    it holds for orders that change tools where the result does.
    """
    if found is None:
        return None
    unit, travel = found.unit, found.travel
    what = "travel time" if unit == "s" else "travel"
    if found.bound is None:
        return f"no bound on the {what}: {found.skipped}"
    if found.gap_percent is None or found.gap_percent > INFORMS_PERCENT:
        text = f"{what} {travel:,.1f} {unit}; no useful bound was proven in the time it is given"
        return text if verbose else None
    above = f"at most {found.gap_percent:.1f} % more {what} than the best order there can be"
    above += " with these changes of tools" * fewer_changes
    if found.gap_percent <= 100.0 * ROUNDING:
        above = f"no order has less {what}: proven"
    return f"{above} ({travel:,.1f} {unit} ≥ {found.bound:,.1f} {unit})" if verbose else above


def whole_file_line(times: FileTimes | None) -> str | None:
    """Return one line on why a whole file takes longer than its source; None if it does not."""
    if times is None or times.before_s is None or not is_longer(times.before_s, times.after_s):
        return None
    return (
        "the file takes longer than its source, which may retract less, lift while it travels or "
        "wait less for what must cool; where time is what counts, print the source"
    )


def changes_line(before: Metrics, after: Metrics) -> str:
    """Return what fewer changes of tools save; empty where there are not fewer."""
    was, now = before.get("tool_changes") or 0, after.get("tool_changes") or 0
    if now >= was:
        return ""
    return (
        f"changes of tools {was:,} -> {now:,}: the {was - now:,} less also save what the machine "
        "takes for each, which no file states"
    )


def searched_line(after: Metrics) -> str:
    """Return what was searched, and how."""
    return (
        f"planner {after['planner']} for {after['objective']}, freedom {after['freedom']}, "
        f"seed {after['seed']}"
    )


def team_lines(after: Metrics, heads: Sequence[str]) -> list[str]:
    """Return what several heads gain over one, and how much of the time each prints."""
    makespan, bound = after["makespan_s"], after["bound"]["bound_s"]
    proven = "bound proven for the pieces as they are cut" if "cut" in after else "proven bound"
    shares = [
        f"{name} {100.0 * spent / makespan:.0f} %"
        for name, spent in zip(heads, after["printing_s_per_head"], strict=True)
    ]
    lines = [
        f"{after['one_head_s'] / makespan:.2f} times as fast as one head alone "
        f"({clock_time(after['one_head_s'])}), and {100.0 * (makespan / bound - 1.0):.0f} % "
        f"above the {proven} ({clock_time(bound)})",
        f"of the print time each head prints: {', '.join(shares)}",
        *(_cut_lines(after["cut"]) if "cut" in after else []),
        idle_line(after),
    ]
    return list(filter(None, lines))


def _cut_lines(cut: CutMetrics) -> list[str]:
    """Return what was cut so that heads share it."""
    shows = f"{cut['outside']:,} of them outside" if cut["outside"] else "none of them outside"
    of = [f"{count:,} in {role.replace('_', ' ')}" for role, count in cut.get("roles", {}).items()]
    cuts = f"{cut['contours']:,} contours are cut at {cut['cuts']:,} places, {shows}"
    cuts += f" ({', '.join(of)})" if of else ""
    welds = (
        f"{cut['welds']:,} welds, the rest in one go: {weld_time(cut['weld_median_s'])} old in the "
        f"median, {weld_time(cut['weld_most_s'])} at most"
    )
    return [cuts, *([welds] if cut["welds"] else [])]


def weld_time(seconds: float) -> str:
    """Return the age of a weld in words."""
    return f"{seconds:.1f} s" if seconds < 60.0 else clock_time(seconds)


def figures(
    result: Result, paths: Sequence[Path], times: FileTimes | None = None
) -> dict[str, Any]:
    """Return what `--json` prints of a result that was written to `paths`."""
    planned = result.planned
    problem, source = planned.problem, result.source
    return {
        "input": str(source.path),
        "machine": problem.machine.name,
        "slicer": problem.job.slicer,
        "sliced_by": source.sliced_by or None,
        "edges": problem.graph.n_edges,
        "barriers": [f"{b.text} (line {b.line}): {b.reason}" for b in problem.job.barriers],
        "notes": list(problem.job.notes),
        "seconds": {name: round(value, 3) for name, value in planned.seconds.items()},
        "before": planned.before.metrics,
        "after": planned.after.metrics,
        "gain": summary_of(planned.before.metrics, planned.after.metrics),
        "file_time_s": {"before": times.before_s, "after": times.after_s} if times else None,
        "kept_source": times is not None and times.kept,
        "planned_already": None,
        **({"team": planned.after.metrics["team"]} if "team" in planned.after.metrics else {}),
        "made_safe": source.original is not None,
        "verified": True,
        "written": [str(path) for path in paths],
    }


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


def rows_of(
    before: Metrics, after: Metrics, *, verbose: bool = False
) -> list[tuple[str, str, str, str]]:
    """Return the figures of a result against its source: label, before, after and change.

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
    rows = []
    for key in [key for key in labels if key in figures]:
        was, now = figures[key]
        by = "" if key in COUNTS else change(was, now)
        rows.append((labels[key], shown(key, was), shown(key, now), by))
    return rows


def gain_table(before: Metrics, after: Metrics, *, verbose: bool = False) -> Table:
    """Return the table of what was gained."""
    table, first = Table(), compared_order(before)
    table.add_column("")
    for name in (first, "after", "change"):
        table.add_column(name, justify="right")
    for row in rows_of(before, after, verbose=verbose):
        table.add_row(*row)
    return table


def plain_lines(before: Metrics, after: Metrics, *, verbose: bool = False) -> list[str]:
    """Return the same as lines, for a log without columns."""
    of = "" if compared_order(before) == "before" else f" ({compared_order(before)})"
    return [
        f"{label}: {was}{of} → {now}" + (f" ({by})" if by else "")
        for label, was, now, by in rows_of(before, after, verbose=verbose)
    ]
