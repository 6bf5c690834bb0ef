"""One head for everything: the yardstick that several heads are compared with.

Where no head reaches the whole print, several follow the one order in turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from decmcts.arrays import Flags
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.machine_fit import require_printable
from decmcts.print.motion import path_time
from decmcts.print.toolpath import Toolpath
from decmcts.team.engine.space import Workspaces, build_space

TRIAL_MM = 30.0  # of the travel that says which of two heads is quicker


def split(toolpath: Toolpath, eligible: Flags, live: Sequence[int]) -> list[Toolpath]:
    """Return one toolpath per head that together keep the order of `toolpath`.

    Begins with the head of `live` that may print most, of equal ones the first. Another
    takes over only where the one at work may not print a contour.
    """
    head = np.empty(len(toolpath), np.int64)
    now = max(live, key=lambda r: int(eligible[:, r].sum()))
    for i, contour in enumerate(toolpath.order):
        if not eligible[contour, now]:
            now = next(r for r in live if eligible[contour, r])
        head[i] = now
    parts = []
    for r in range(eligible.shape[1]):
        at = np.flatnonzero(head == r)
        order, is_reversed, entry = toolpath.order[at], toolpath.reversed[at], toolpath.entry[at]
        parts.append(Toolpath(order, is_reversed, entry, at))
    return parts


def hand_over(toolpaths: Sequence[Toolpath], eligible: Flags) -> Sequence[Toolpath]:
    """Let other heads do what the only busy one can not; else return the toolpaths as they are."""
    busy = [r for r, toolpath in enumerate(toolpaths) if len(toolpath)]
    if len(busy) != 1 or len(toolpaths) != eligible.shape[1]:
        return toolpaths
    order = toolpaths[busy[0]].order
    known = (order >= 0).all() and (order < len(eligible)).all()
    if not known or eligible[order, busy[0]].all() or not eligible[order].any(axis=1).all():
        return toolpaths
    return split(toolpaths[busy[0]], eligible, range(len(toolpaths)))


def one_head_toolpaths(
    job: PrintJob, machine: Machine, toolpath: Toolpath, *, live: Sequence[int] | None = None
) -> list[Toolpath]:
    """Return the toolpaths, one per head, in which one head prints what it can in this order.

    The head that may print most does so, of several the quickest, of these the one that parks
    nearest; contours it can not print go to another, and conflicting ones keep the order.

    Parameters
    ----------
    live : Sequence[int] | None
        Heads that may be used; None: all.

    Raises
    ------
    InputError
        If none of these heads may print some contour.
    """
    team = range(len(machine.heads)) if live is None else sorted(live)
    space = build_space(job, machine, team)
    require_printable(job.contours, machine, space.eligible, live=team)
    ranked = sorted(nearest_first(space, team), key=lambda r: _slowness(machine, r))
    return split(toolpath, space.eligible, ranked)


def nearest_first(space: Workspaces, team: Sequence[int]) -> list[int]:
    """Return heads by how far they park from the print along x or y, the larger of both."""
    if not len(space.boxes):
        return list(team)
    low, high = space.boxes[:, 0::2].min(axis=0), space.boxes[:, 1::2].max(axis=0)
    parks = space.parks[:, :2]
    off = np.maximum(np.maximum(low - parks, parks - high), 0.0).max(axis=1)
    return sorted(team, key=lambda r: (float(off[r]), r))


def lone_machine(machine: Machine) -> Machine:
    """Return the yardstick of a team: its quickest head alone, reaching everything.

    Of equal ones the first. "So many times faster than one head" compares with a plan for this
    machine: where no head reaches the whole print, `one_head_toolpaths` uses several.
    """
    far = 1e6
    quickest = min(range(len(machine.heads)), key=lambda r: _slowness(machine, r))
    head = machine.heads[quickest]
    return machine.alone(replace(head, reach_min=(-far,) * 3, reach_max=(far,) * 3, tools=()))


def _slowness(machine: Machine, r: int) -> float:
    """Return the seconds that a travel of `TRIAL_MM` along X and then Y takes a head."""
    head = machine.heads[r]
    limits = machine.limits_of(head)
    path = TRIAL_MM * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]])
    return head.pace * path_time(path, limits.travel_feed, limits)
