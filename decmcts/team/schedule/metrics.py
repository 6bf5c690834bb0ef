"""What a joint plan costs: travel in the paper's metric, travel emitted, time.

Figures only; how they are shown is the command line's business.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.print.job import PrintJob
from decmcts.print.metrics import Metrics
from decmcts.print.plan import ActionKind, HeadActions, JointPlan
from decmcts.print.toolpath import Toolpath, extrusionless_travel


def head_toolpath(actions: HeadActions) -> Toolpath:
    """Return the contours one head prints, in its order."""
    printing = actions.kind == ActionKind.PRINT
    return Toolpath(actions.contour[printing], actions.reversed[printing], actions.entry[printing])


def path_lengths(actions: HeadActions) -> NDArray[np.float64]:
    """Return the length of each action's path in mm, (k,)."""
    steps = np.linalg.norm(np.diff(actions.path, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    first, last = actions.path_offsets[:-1], actions.path_offsets[1:] - 1
    return np.asarray(along[np.maximum(last, first)] - along[first])


def plan_metrics(job: PrintJob, plan: JointPlan) -> Metrics:
    """Return contours, both travels (mm), makespan and the heads' shares of a plan.

    `print_time_s` is the estimated time of the whole print, the makespan. A head is busy
    while it prints, travels (to its park, too) or rests for plastic to cool. Of a print with
    several tools, `tool_changes` counts how often a head changes them.
    """
    printed, bare, emitted = [], 0.0, 0.0
    busy, prints, travels, waits = [], [], [], []
    for actions in plan.heads:
        toolpath = head_toolpath(actions)
        lengths = path_lengths(actions)
        printing = actions.kind == ActionKind.PRINT
        printed.append(len(toolpath))
        bare += extrusionless_travel(job.contours, toolpath)
        emitted += float(lengths[~printing].sum())
        seconds = actions.end_s - actions.begin_s
        busy.append(float(seconds.sum()))
        moving = (actions.kind == ActionKind.TRAVEL) | (actions.kind == ActionKind.PARK)
        prints.append(float(seconds[printing].sum()))
        travels.append(float(seconds[moving].sum()))
        waits.append(seconds[actions.kind == ActionKind.WAIT])
    found: Metrics = {
        "contours": sum(printed),
        "contours_per_head": printed,
        "extrusionless_travel_mm": bare,
        "emitted_travel_mm": emitted,
        "print_time_s": plan.makespan_s,
        "makespan_s": plan.makespan_s,
        "busy_s_per_head": busy,
        "printing_s_per_head": prints,
        "travelling_s_per_head": travels,
        "waits": sum(map(len, waits)),
        "waits_s": float(sum(w.sum() for w in waits)),
        "cross_head_waits": sum(len(actions.after_head) for actions in plan.heads),
    }
    if len(np.unique(job.contours.tool)) > 1:
        found["tool_changes"] = _changes(job, plan)
    return found


def _changes(job: PrintJob, plan: JointPlan) -> int:
    """Return how often heads change tools from contour to contour."""
    tools = (job.contours.tool[head_toolpath(actions).order] for actions in plan.heads)
    return sum(int(np.count_nonzero(np.diff(row))) for row in tools)
