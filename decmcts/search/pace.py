"""What a travel costs in seconds: the source's habits under the machine's limits.

The search prices a travel by its two ends alone (`decmcts._kernels.metric`);
how long a whole plan takes is `decmcts.team.timing`'s.
"""

from __future__ import annotations

import numpy as np

from decmcts.print.job import PrintJob
from decmcts.print.machine import MotionLimits
from decmcts.print.motion import (
    level_travel,
    path_time,
    retraction_time,
    travel_feed,
    upright_travel,
)
from decmcts.search.problem import Pace


def pace_of(job: PrintJob, limits: MotionLimits) -> Pace:
    """Return how fast the travels of a print go.

    Long ones are retracted (wiped, if the source wipes), lifted by the source's
    own hop, lowered and primed again; the lift over what is printed higher is
    not known before there is an order.
    """
    settings = job.settings
    hop_s = retraction_time(settings, limits, np.inf)
    if settings.hop_mm > 0.0:
        lift = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, settings.hop_mm]])
        hop_s += 2.0 * path_time(lift, settings.z_feed or travel_feed(settings, limits), limits)
    return Pace(
        *level_travel(settings, limits), *upright_travel(settings, limits), hop_s,
        settings.retract_min_travel_mm,
    )  # fmt: skip
