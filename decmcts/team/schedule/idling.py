"""How much later beads begin where their head has stood idle: it is pushed forth again, and primed.

It is pulled back while it stands, and hot again by then, which takes no time of the plan.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.motion import filament_time
from decmcts.print.plan import ActionKind, HeadActions
from decmcts.print.stands import practice_of, primed_before, stands_of

Floats = NDArray[np.float64]


def idle_seconds(actions: HeadActions, h: int, job: PrintJob, machine: Machine) -> Floats:
    """Return by how much the actions of head number h take longer, (k,) seconds."""
    head, more = machine.heads[h], np.zeros(len(actions))
    prints = np.flatnonzero(actions.kind == ActionKind.PRINT)
    if not len(prints):
        return more
    practice, settings = practice_of(actions, job, head.idle)
    usual = settings.retract_mm
    deep = max(usual, practice.retract_mm)
    stands = stands_of(actions, h, job.contours.epoch, head.idle.after_s)
    pulled = np.zeros(len(actions), np.bool_)
    pulled[prints[np.searchsorted(prints, list(stands))]] = True
    primed = primed_before(actions, head.idle.after_s)
    limits, feed = machine.limits_of(head), settings.unretract_feed
    before = filament_time(usual, feed, limits)
    for k in np.flatnonzero(pulled | primed).tolist():
        pushed = (deep if pulled[k] else usual) + (practice.prime_mm if primed[k] else 0.0)
        more[k] = (filament_time(pushed, feed, limits) - before) * head.pace
    return more
