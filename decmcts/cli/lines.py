"""What is said of a result, in lines for a person and in figures for a program."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from decmcts.cli.console import clock_time, summary_of
from decmcts.planning.one_head.certificate import ROUNDING, Certificate
from decmcts.planning.problem.planned import Planned
from decmcts.planning.result import Result
from decmcts.planning.writing.file_times import COUNTS_SHARE, FileTimes, is_longer
from decmcts.search.bounds.certificate import INFORMS_PERCENT


def bound_line(found: Certificate | None) -> str | None:
    """Return one line on travel, bound and gap; None if no bound was asked for.

    A bound too far away to tell a good order from a quick one is not shown; it is in
    the metrics for programs.
    """
    if found is None:
        return None
    unit, travel = found.unit, found.travel
    what = "travel time" if unit == "s" else "travel"
    if found.bound is None:
        return f"no bound on the {what}: {found.skipped}"
    if found.gap_percent is None or found.gap_percent > INFORMS_PERCENT:
        return f"{what} {travel:,.1f} {unit}; no useful bound was proven in the time it is given"
    above = f" → at most {found.gap_percent:.1f} % above optimal"
    if found.gap_percent <= 100.0 * ROUNDING:
        above = " → proven optimal"
    return f"{what} {travel:,.1f} {unit} ≥ bound {found.bound:,.1f} {unit}{above}"


def file_time_line(
    before_s: float, after_s: float, retracted_mm: float | None, *, combs: bool = False
) -> str:
    """Return one line on the time of the whole file, and on why it may have grown if it did.

    `retracted_mm` is the travel from which filament is retracted, None if it never is;
    `combs` says that longer ones inside the part are left bare, as in the source.
    Some slicers lift while they travel.
    """
    line = f"print time of the whole file: {clock_time(before_s)} → {clock_time(after_s)}"
    if not is_longer(before_s, after_s):
        return line
    kind = "travel that leaves the part" if combs else "travel"
    habit = (
        "" if retracted_mm is None else f"every {kind} from {retracted_mm:g} mm up is retracted, "
    )
    return (
        f"{line}, longer: here {habit}lifts go straight up and what must cool is waited for, which "
        "the source may do less; where time is what counts, print the source"
    )


def whole_file_line(planned: Planned, times: FileTimes | None) -> str | None:
    """Return the line on the time of a result's whole file; None where there is no other."""
    if times is None or times.before_s is None:
        return None
    settings = planned.problem.job.settings
    retracts = any(one.firmware_retraction or one.retract_mm > 0.0 for one in settings.each())
    retracted_mm = settings.retract_min_travel_mm if retracts else None
    combs = settings.bare_inside_mm > 0.0
    return file_time_line(times.before_s, times.after_s, retracted_mm, combs=combs)


def kept_line(times: FileTimes) -> str:
    """Return why the source was kept."""
    assert times.refused_s is not None
    if times.over_walls_mm is not None:
        return (
            f"{times.over_walls_mm:.0f} mm of the new order's travels would lead over outer walls, "
            f"of the source's {times.before['travel_over_walls_mm']:.0f} mm; "
            "--avoid-walls never --allow-slower writes it all the same"
        )
    both = (
        f"the new order would take {clock_time(times.refused_s)} and the source takes "
        f"{clock_time(times.after_s)}"
    )
    if not times.gained:
        return (
            f"nothing to gain: {both}, and neither travel, retractions nor travel over outer walls "
            f"fall by {100 * COUNTS_SHARE:g} % or more; --allow-slower writes it all the same"
        )
    return f"{both}; --allow-slower writes it all the same"


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
