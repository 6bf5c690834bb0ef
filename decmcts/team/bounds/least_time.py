"""The least time to print each contour: by the fastest eligible head, from the best vertex.

For bounds. Travel is `decmcts.team.bounds.least_travel`'s. Heads of a team stand still between
actions, for they may have to wait there, so their times are those of `decmcts.print.motion` from
rest to rest. A head alone may run on from contour to contour, so its times are those at the
contours' feeds, without any ramps.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from decmcts.print.job import PrintJob
from decmcts.print.loops import rotated
from decmcts.print.machine import Machine
from decmcts.print.motion import segment_times
from decmcts.print.seam import SeamEntries

NO_RAMP = 1e15  # mm/s²: any feed is reached at once

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LeastTimes:
    """No plan spends less on printing, in seconds."""

    contour: Floats  # (n,)
    segment: Floats
    """(n_points,) of the segment ending at each point, 0 at a start. Those of a contour may sum
    to less than the contour's, since each is by the head and entry that are best for it."""


def least_times(
    job: PrintJob,
    machine: Machine,
    eligible: NDArray[np.bool_],
    entries: SeamEntries | None = None,
) -> LeastTimes:
    """Return the least times over the heads that may print each contour, and over its entries.

    O(heads with limits of their own · entries of one contour · points).

    Parameters
    ----------
    eligible : (n, heads)
        A contour that no head may print is taken to be any head's.
    entries : SeamEntries | None
        Where loops may be entered besides as sliced; None: nowhere.
    """
    contours = job.contours
    may = eligible | ~eligible.any(axis=1, keepdims=True)
    owner = np.repeat(np.arange(len(contours)), np.diff(contours.offsets))
    least = LeastTimes(np.full(len(contours), np.inf), np.full(len(contours.points), np.inf))
    limits, alone = [machine.limits_of(head) for head in machine.heads], len(machine.heads) == 1
    if alone:
        four = (NO_RAMP,) * 4
        limits = [
            replace(
                limits[0], max_acceleration=four, acceleration=NO_RAMP, retract_acceleration=NO_RAMP
            )
        ]
    kinds = {own: [k for k, other in enumerate(limits) if other == own] for own in limits}
    for entry in choices(entries, len(contours)):
        run, offsets = rotated(contours, entry)
        running = replace(
            contours, points=run.points, extrusion=run.extrusion, feed=run.feed, offsets=offsets
        )
        set_by = None if job.acceleration is None or alone else job.acceleration[run.rows]
        for kind, heads in kinds.items():
            mine = np.asarray(may[:, heads].any(axis=1))
            seconds = segment_times(running, kind, set_by)
            whole = np.add.reduceat(seconds, offsets[:-1])
            parts = np.bincount(run.rows, seconds, len(owner))
            np.minimum(least.contour, whole, out=least.contour, where=mine)
            np.minimum(least.segment, parts, out=least.segment, where=mine[owner])
    return least


def choices(entries: SeamEntries | None, n: int) -> Iterator[NDArray[np.int32]]:
    """Yield vertices of all contours, (n,), until each contour had all it may be entered at."""
    yield np.zeros(n, np.int32)
    if entries is None:
        return
    first, count = entries.offsets[:-1], np.diff(entries.offsets)
    for k in range(int(count.max(initial=0))):
        chosen = entries.vertices[first + np.minimum(k, count - 1)]
        if chosen.any():
            yield chosen
