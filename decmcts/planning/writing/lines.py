"""Lines of text about a plan, for the header of its G-code and for a terminal."""

from __future__ import annotations

import numpy as np

from decmcts.formats.gcode.writing.own_header import SAFE, TRAVEL, as_sliced
from decmcts.planning.problem.planned import Planned
from decmcts.planning.writing.file_times import COUNTS_SHARE, FileTimes, compared_with
from decmcts.print.figures import clock_time
from decmcts.print.job import PrintJob
from decmcts.print.plan import ActionKind, PlanDocument
from decmcts.version import __version__

CUT = "{contours} contours are cut at {cuts} places, {outside} of them outside"
PRINT_TIME = "estimated print time {was:.0f} s -> {now:.0f} s"


def header_lines(planned: Planned) -> list[str]:
    """Return the comment lines that say what was done to the file."""
    was, now = planned.before.metrics, planned.after.metrics
    machine, aim = planned.after.machine, now.get("objective", "makespan")
    if now["planner"] == "dec-mcts":  # the objective is that of one head's own order
        aim = "makespan"
    seam = f" ({now['seam']})" if "seam" in now else ""
    sliced = as_sliced(planned.problem.document.preamble)  # of a file that was planned before
    travel_mm = was["extrusionless_travel_mm"]
    if sliced is not None and sliced.travel_mm is not None:
        travel_mm = sliced.travel_mm
    made_safe = planned.problem.source.original is not None or (sliced and sliced.made_safe)
    compared = compared_with(planned.problem) is not None
    whole = aim != "makespan" and compared  # `with_time` says it later
    return [
        f"reordered by decmcts {__version__} for machine {machine.name}",
        f"planner {now['planner']} for {aim}, freedom {now['freedom']}{seam}, seed {now['seed']}",
        *([SAFE] if made_safe else []),
        *([CUT.format(**now["cut"])] if "cut" in now else []),
        TRAVEL.format(was=travel_mm, now=now["extrusionless_travel_mm"]),
        *([] if whole else [PRINT_TIME.format(was=was["print_time_s"], now=now["print_time_s"])]),
        *(line for line in (cooling_line(planned.after), layers_line(planned)) if line),
        "verified: every extrusion exactly once, no contact of head and print",
    ]


def layers_line(planned: Planned) -> str | None:
    """Return one line on layers entered more often than in the source; None if they are not."""
    all_actions, layer = planned.after.plan.heads, planned.problem.job.contours.layer
    if len(all_actions) > 1 or not len(layer):
        return None
    order = all_actions[0].contour[all_actions[0].kind == ActionKind.PRINT]
    was, now = (1 + int(np.count_nonzero(np.diff(row))) for row in (layer, layer[order]))
    if now <= was:
        return None
    return (
        f"layers are entered {now} times instead of {was}: viewers count every change of height "
        "as a layer, so their sliders follow the sequence"
    )


def cooling_line(document: PlanDocument) -> str | None:
    """Return one line on how long a plan waits for cooling; None where no rule was asked for."""
    rule, metrics = document.min_layer_time_s, document.metrics
    if rule <= 0.0:
        return None
    count = metrics["waits"]
    waits = f"waits {metrics['waits_s']:,.1f} s for cooling in {count} place{'s' * (count != 1)}"
    due = f"a spot is printed over after {rule:g} s, or as soon as in the source"
    if metrics.get("as_sliced"):
        return f"the source's own order was the fastest ({due}; --min-layer-time 0 drops this rule)"
    return f"{waits if count else 'no wait for cooling'}: {due}"


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


def source_lines(job: PrintJob) -> list[str]:
    """Return what in the source bound the search, or was not taken as it is, a line each."""
    held = [f"nothing moves across line {b.line}: {b.text} ({b.reason})" for b in job.barriers]
    return [*held, *job.notes]
