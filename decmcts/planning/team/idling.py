"""How often heads stand idle by a plan, and what their files do there, as figures."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from decmcts.formats.gcode.dialects.dialect import IDLE_MARK
from decmcts.planning.problem.planned import Planned
from decmcts.print.metrics import IdleMetrics, Metrics
from decmcts.print.plan import ActionKind, HeadActions
from decmcts.print.stands import practice_of, primed_before, stands_of

_COOLS = re.compile(rb"^M104 [^\r\n]* " + re.escape(IDLE_MARK.encode()) + rb"\r?$", re.M)


def with_idling(planned: Planned) -> Planned:
    """Return a judged plan with the figures `idle`, where heads stand idle before beads.

    How often they cool is known only of files that are written.
    """
    rows = np.array(
        [_counts(planned, actions, h) for h, actions in enumerate(planned.after.plan.heads)]
    )
    waits, seconds, pulled, primed = rows.sum(axis=0).tolist()
    if not waits and not primed:
        return planned
    idle: IdleMetrics = {
        "waits": int(waits), "waits_s": seconds, "pulled": int(pulled), "primed": int(primed)
    }  # fmt: skip
    if planned.head_files:
        idle["cooled"] = sum(map(_cooled, planned.head_files))
    metrics: Metrics = {**planned.after.metrics, "idle": idle}
    return replace(planned, after=replace(planned.after, metrics=metrics))


def _counts(planned: Planned, actions: HeadActions, h: int) -> tuple[float, float, float, float]:
    """Return of a head: idle waits, their seconds, how many it is pulled back for, times primed."""
    job, machine = planned.problem.job, planned.after.machine
    if not (actions.kind == ActionKind.PRINT).any():
        return 0, 0.0, 0, 0
    idle = machine.heads[h].idle
    practice, settings = practice_of(actions, job, idle)
    stands = stands_of(actions, h, job.contours.epoch, idle.after_s)
    further = practice.retract_mm > settings.retract_mm
    primed = primed_before(actions, idle.after_s).sum() if practice.prime_mm else 0
    seconds = sum(stand.seconds for stand in stands.values())
    return len(stands), seconds, len(stands) * further, int(primed)


def _cooled(text: bytes) -> int:
    """Return how often a file cools its hot end to standby."""
    return sum(1 for _ in _COOLS.finditer(text))
