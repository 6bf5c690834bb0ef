"""Where the heads of a plan stand idle, and when they are heated again.

A head stands where its action begins later than the one before it has ended, or where it rests.
A stand counts as idle from `Idle.after_s` up, where a bead follows and the source's own lines do
not stand in between: those set filament and heat by themselves.

A wait for another head is of unknown length: its signal may come sooner than planned, or later.
So the hot end is heated by the clock, before the wait: it dwells at standby until there is left,
of `SAFE` of the planned stand, what heating takes. It loses time only where the other head is
sooner than planned by more than the rest. What it has to stand behind the signal (a lag, a rest
for cooling) is known exactly, so where that is long enough it is heated within it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from decmcts.arrays import Flags, Int32s
from decmcts.print.job import PrintJob, ProcessSettings
from decmcts.print.machine import Idle, Practice
from decmcts.print.plan import ActionKind, HeadActions

SAFE = 0.9


class Stand(NamedTuple):
    """A head stands before an action, or is that action a rest, for it."""

    action: int
    seconds: float  # by the plan
    behind_s: float  # of it, behind the signals that it waits for


class Standby(NamedTuple):
    """How long a hot end is left at standby, and when it is heated again."""

    cool_s: float
    heat_s: float
    behind: bool  # both behind the signals; else it cools before them, and is heated while waiting


def practice_of(
    actions: HeadActions, job: PrintJob, idle: Idle
) -> tuple[Practice, ProcessSettings]:
    """Return what a head does where it stands idle, and how it travels, by the tool it prints with.

    It prints something. Firmware that retracts knows no other length.
    """
    first = int(np.flatnonzero(actions.kind == ActionKind.PRINT)[0])
    tool = int(job.contours.tool[actions.contour[first]])
    practice, settings = idle.over(job.practice(tool)), job.settings.for_tool(tool)
    if settings.firmware_retraction:
        practice = replace(practice, retract_mm=0.0)
    return practice, settings


def stands_of(actions: HeadActions, head: int, epoch: Int32s, after_s: float) -> dict[int, Stand]:
    """Return where a head stands idle before a bead, by the action; `epoch` is each contour's."""
    prints = np.flatnonzero(actions.kind == ActionKind.PRINT)
    if not len(prints):
        return {}
    begin, end = np.asarray(actions.begin_s), np.asarray(actions.end_s)
    rests = actions.kind == ActionKind.WAIT
    rested = np.where(rests, end - begin, 0.0)
    seconds = begin - np.concatenate([[0.0], end[:-1]]) + rested
    own = epoch[actions.contour[prints]]
    parted = np.diff(own, prepend=epoch.min()) != 0
    found = {}
    for k in np.flatnonzero(seconds >= after_s).tolist():
        ahead = int(np.searchsorted(prints, k))
        if ahead < len(prints) and not parted[ahead]:
            lags = [edge.lag_s for edge in actions.after_edges(k) if edge.head != head]
            behind_s = max(lags, default=0.0) + float(rested[k])
            found[k] = Stand(k, float(seconds[k]), behind_s)
    return found


def primed_before(actions: HeadActions, after_s: float) -> Flags:
    """Return the actions that lay a bead where the head has laid nothing for so long, (k,)."""
    prints = np.flatnonzero(actions.kind == ActionKind.PRINT)
    laid_s = np.concatenate([[0.0], np.asarray(actions.end_s)[prints[:-1]]])[: len(prints)]
    found = np.zeros(len(actions), np.bool_)
    found[prints] = np.asarray(actions.begin_s)[prints] - laid_s >= after_s
    return found


def standby_in(stand: Stand, degrees: float, idle: Idle) -> Standby | None:
    """Return how a hot end cools by up to some degrees in a stand; None: it stays hot.

    That is where less than `Idle.after_s` are left before it has to be heated again.
    """
    heat_s = degrees / idle.heat_c_s
    cool_s = SAFE * stand.seconds - heat_s
    if degrees <= 0.0 or cool_s < idle.after_s:
        return None
    if cool_s > SAFE * (stand.seconds - stand.behind_s):
        return Standby(stand.behind_s - heat_s, heat_s, behind=True)
    return Standby(cool_s, heat_s, behind=False)
