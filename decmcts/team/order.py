"""The partial order of a joint plan: units, what each must wait for, what comes later.

Front of `decmcts._kernels.schedule` and `.partial_order`: validates sequences and turns a replay
into arrays over units. Paths and exact times are `decmcts.team.schedule`'s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.partial_order import after_edges, first_later
from decmcts._kernels.schedule import Queues, replay
from decmcts._kernels.units import STUCK, Floor, Visits
from decmcts.errors import InputError
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.motion import job_times, level_travel, retraction_time, upright_travel
from decmcts.print.toolpath import Toolpath, endpoints
from decmcts.team.space import Space, require_printable


@dataclass(frozen=True, slots=True)
class UnitOrder:
    """Units of all heads in the order they begin, with their waits."""

    head: NDArray[np.int32]  # (m,)
    kind: NDArray[np.int8]  # (m,) UNIT_PRINT, UNIT_TRAVEL, UNIT_YIELD, UNIT_PARK
    contour: NDArray[np.int32]  # (m,) -1 unless printed
    target: NDArray[np.float64]  # (m, 3) where it ends
    box: NDArray[np.float64]  # (m, 4)
    begin_s: NDArray[np.float64]  # (m,) estimate
    end_s: NDArray[np.float64]  # (m,) estimate
    own: NDArray[np.int64]  # (m,) index within the head's units
    rows: NDArray[np.int64]  # (heads, most) row of each head's k-th unit
    counts: NDArray[np.int64]  # (heads,) units of each head
    after: NDArray[np.int64]  # (m, heads) that head's unit that must have ended; -1: none
    later: NDArray[np.int64]  # (m, heads) that head's first unit ordered after this one


def floor_of(job: PrintJob, machine: Machine, space: Space) -> Floor:
    """Return the machine as the scheduling kernels take it.

    Travels are retracted by length alone there. These times only rank what may come
    next: nothing is safe because of them, and the exact ones (`decmcts.team.timing`) look at
    walls. A look at walls in each of the many replays of a team's search would cost more
    than it tells.
    """
    settings, limits = job.settings, machine.limits
    feed, acceleration = level_travel(settings, limits)
    travel = np.array(
        [
            feed,
            acceleration,
            *upright_travel(settings, limits),
            retraction_time(settings, limits),
            settings.retract_min_travel_mm,
        ]
    )
    return Floor(space.gaps, space.parks, travel)


def visits_of(
    job: PrintJob,
    machine: Machine,
    graph: DependencyGraph,
    space: Space,
    toolpaths: Sequence[Toolpath],
) -> Visits:
    """Return entry, exit, room and time of every contour in its chosen traversal."""
    contours = job.contours
    first, last = contours.start.copy(), contours.end.copy()
    for toolpath in toolpaths:
        first[toolpath.order], last[toolpath.order] = endpoints(contours, toolpath)
    seconds = job_times(job, machine.limits)
    return Visits(first, last, space.boxes, seconds, graph.pred_offsets, graph.preds)


def require_complete(
    job: PrintJob, machine: Machine, space: Space, toolpaths: Sequence[Toolpath]
) -> None:
    """Raise InputError unless every contour is printed once, by a head that can."""
    if len(toolpaths) != len(machine.heads):
        raise InputError(
            f"{len(toolpaths)} toolpaths for the {len(machine.heads)} heads of {machine.name}"
        )
    require_printable(job.contours, machine, space.eligible)
    order = np.concatenate([toolpath.order for toolpath in toolpaths])
    counts = np.bincount(order, minlength=len(job.contours))
    wanted = np.arange(len(counts)) < len(job.contours)
    if (counts != wanted).any():
        wrong = int(np.flatnonzero(counts != wanted)[0])
        raise InputError(
            f"contour {wrong} is printed {counts[wrong]} times, expected {int(wanted[wrong])}"
        )
    for r, toolpath in enumerate(toolpaths):
        refused = toolpath.order[~space.eligible[toolpath.order, r]]
        if len(refused):
            raise InputError(
                f"head {machine.heads[r].name} can not print contour {int(refused[0])} "
                f"(reach or tool), {len(refused)} such contours in its toolpath"
            )


def queues_of(toolpaths: Sequence[Toolpath]) -> Queues:
    """Return the toolpaths as the kernels take them; turns count only if all have them."""
    order = np.concatenate([toolpath.order for toolpath in toolpaths]).astype(np.int32)
    offsets = np.cumsum([0, *(len(toolpath) for toolpath in toolpaths)]).astype(np.int64)
    turns = [toolpath.turn for toolpath in toolpaths if toolpath.turn is not None]
    if len(turns) < len(toolpaths):
        return Queues(order, offsets, np.zeros(len(order), np.int64))
    return Queues(order, offsets, np.concatenate(turns).astype(np.int64))


def order_units(visits: Visits, floor: Floor, toolpaths: Sequence[Toolpath]) -> UnitOrder:
    """Replay the sequences and return the partial order they make; raises InputError if stuck."""
    heads, queues = len(toolpaths), queues_of(toolpaths)
    units, verdict = replay(queues, visits, floor, (len(queues.order) + 2) * heads * 3)
    if verdict == STUCK:
        raise InputError(
            "the heads' sequences contradict each other: no head can begin its next contour",
            advice="every contour must come after those it rests on, on whichever head they are",
        )
    m = int(units.used[0])
    sooner = np.argsort(units.begin[:m], kind="stable")
    units = units._replace(**{name: getattr(units, name)[sooner] for name in units._fields[:-1]})
    own, rows, counts = _index(units.head, heads)
    place = np.empty(len(visits.seconds), np.int64)
    printing = np.flatnonzero(units.contour >= 0)
    place[units.contour[printing]] = printing
    after = after_edges(units, own, place, visits, floor)
    later = first_later(units, own, rows, after, counts)
    return UnitOrder(
        units.head,
        units.kind,
        units.contour,
        units.target,
        units.box,
        units.begin,
        units.end,
        own,
        rows,
        counts,
        after,
        later,
    )


def _index(
    head: NDArray[np.int32], heads: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return each unit's index within its head, the rows of each head, and how many it has."""
    counts = np.bincount(head, minlength=heads).astype(np.int64)
    own = np.empty(len(head), np.int64)
    rows = np.zeros((heads, int(counts.max(initial=0))), np.int64)
    for r in range(heads):
        mine = np.flatnonzero(head == r)
        own[mine] = np.arange(len(mine))
        rows[r, : len(mine)] = mine
    return own, rows, counts
