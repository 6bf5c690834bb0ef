"""What a joint plan costs: travel in the paper's metric, travel emitted, time.

Figures only; how they are shown is the command line's business.
"""

from __future__ import annotations

import numpy as np

from decmcts.arrays import Floats
from decmcts.print.job import PrintJob
from decmcts.print.metrics import Metrics
from decmcts.print.plan import ActionKind, HeadActions, JointPlan
from decmcts.print.toolpath import Toolpath, extrusionless_travel


def head_toolpath(actions: HeadActions) -> Toolpath:
    """Return the contours one head prints, in its order."""
    printing = actions.kind == ActionKind.PRINT
    return Toolpath(actions.contour[printing], actions.reversed[printing], actions.entry[printing])


def path_lengths(actions: HeadActions) -> Floats:
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
    heads, toolpaths = plan.heads, [head_toolpath(actions) for actions in plan.heads]

    def seconds_of(*kinds: ActionKind) -> list[float]:
        taken = [(head.end_s - head.begin_s)[np.isin(head.kind, kinds)] for head in heads]
        return [float(seconds.sum()) for seconds in taken]

    found: Metrics = {
        "contours": sum(map(len, toolpaths)),
        "contours_per_head": [len(toolpath) for toolpath in toolpaths],
        "extrusionless_travel_mm": sum(
            extrusionless_travel(job.contours, path) for path in toolpaths
        ),
        "emitted_travel_mm": sum(
            float(path_lengths(head)[head.kind != ActionKind.PRINT].sum()) for head in heads
        ),
        "print_time_s": plan.makespan_s,
        "makespan_s": plan.makespan_s,
        "busy_s_per_head": seconds_of(*ActionKind),
        "printing_s_per_head": seconds_of(ActionKind.PRINT),
        "travelling_s_per_head": seconds_of(ActionKind.TRAVEL, ActionKind.PARK),
        "waits": sum(int((head.kind == ActionKind.WAIT).sum()) for head in heads),
        "waits_s": sum(seconds_of(ActionKind.WAIT)),
        "cross_head_waits": sum(len(head.after_head) for head in heads),
    }
    if len(np.unique(job.contours.tool)) > 1:
        tools = (job.contours.tool[toolpath.order] for toolpath in toolpaths)
        found["tool_changes"] = sum(int(np.count_nonzero(np.diff(row))) for row in tools)
    return found
