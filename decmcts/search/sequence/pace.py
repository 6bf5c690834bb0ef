"""What a travel costs in seconds: the source's habits under the machine's limits.

The search prices a travel by its two ends, and the walls between
(`decmcts.search.sequence.metric_kernels`); how long a whole plan takes is
`decmcts.team.schedule.timing`'s.
"""

from __future__ import annotations

import math

import numpy as np

from decmcts.print.job import PrintJob, ProcessSettings
from decmcts.print.machine import MotionLimits
from decmcts.print.motion import (
    level_travel,
    path_time,
    retraction_time,
    travel_feed,
    upright_travel,
)
from decmcts.print.walls import walls_for
from decmcts.search.sequence.problem import Pace


def pace_of(job: PrintJob, limits: MotionLimits) -> Pace:
    """Return how fast the travels of a print go.

    A travel is retracted (wiped, if the source wipes), lifted by the source's own hop,
    lowered and primed again. Travels shorter than the source's least, and those that
    stay bare inside the part, go without all that. How far a travel must lift over
    what is printed by then is not known before there is an order, and not counted. Of several
    tools it is the mean, weighed by what they print: within an epoch there is but one, and every
    order has the same contours of each.
    """
    settings = job.settings
    hop_s = _hop_seconds(settings, limits)
    if settings.of_tools:
        tools, count = np.unique(job.contours.tool, return_counts=True)
        each = [_hop_seconds(settings.for_tool(tool), limits) for tool in tools.tolist()]
        hop_s = float(np.average(each, weights=count))
    return Pace(
        *level_travel(settings, limits), *upright_travel(settings, limits), hop_s,
        math.nextafter(settings.retract_min_travel_mm, 0.0), settings.bare_inside_mm,
        settings.bare_climb_mm, walls=walls_for(job),
    )  # fmt: skip


def _hop_seconds(settings: ProcessSettings, limits: MotionLimits) -> float:
    """Return the seconds a retracted travel takes besides going from end to end."""
    hop_s = retraction_time(settings, limits)
    if settings.hop_mm > 0.0:
        lift = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, settings.hop_mm]])
        hop_s += 2.0 * path_time(lift, settings.z_feed or travel_feed(settings, limits), limits)
    return hop_s
