"""How long each spot of a print must cool before it is printed over, and orders that let it.

The rule is a slicer's: no spot is printed over within so many seconds. Slicers keep it
for whole layers only. So a plan need not leave more time than the source did between
the last of what is under a contour and its own begin. For one tower of
several that is the time of all the others; for a part alone it is next to nothing.
Waits become actions in `decmcts.team.schedule.waits`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Floats, Int32s, Ints
from decmcts.feasibility.graph import DependencyGraph
from decmcts.feasibility.packed_head import pack_contours
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.lags_kernels import Lags, no_lags
from decmcts.print.machine import Machine
from decmcts.print.motion import job_times
from decmcts.print.plan import ActionKind, HeadActions
from decmcts.print.toolpath import Toolpath, endpoints
from decmcts.search.sequence.timed_lags import TimedLags
from decmcts.team.engine.joint_kernels import Visits
from decmcts.team.engine.order import visits_of
from decmcts.team.engine.space import travel_row
from decmcts.team.engine.spaces_kernels import travel_seconds
from decmcts.team.schedule.cooling_kernels import follow, printed_over

LEAST_LAG_S = 0.05  # shorter lags are dropped
TRAVEL_SHARE = 0.7  # mean travel of a search's orders, as a share of the source's


@dataclass(frozen=True, slots=True)
class TimedOrder:
    """An order with its estimated time."""

    toolpath: Toolpath
    seconds: float  # to the end of the last contour, waits included
    waited_s: float
    at_first_s: float  # waited in the order that was given


def find_lags(
    contours: Contours,
    times: Sequence[tuple[Floats, Floats]],
    min_layer_time_s: float,
    left_s: Floats | None = None,
) -> list[Lags]:
    """Return how long what is under a contour must cool: the rule, or the source's lag if less.

    Parameters
    ----------
    times : sequence of ((n,), (n,))
        When the source begins and ends each contour; one set of lags for each clock,
        for an order must be timed by the clock that its source was timed by.
    left_s : (n,)
        What a source left at least that this one was made of (`time_left`), s.
    """
    n = len(contours)
    if n == 0 or min_layer_time_s <= 0.0:
        return [no_lags(n) for _ in times]
    above, below = _right_under(contours)
    found = []
    for begin, end in times:
        given = _left(above, below, begin, end)
        given = given if left_s is None else np.maximum(given, left_s)
        lag = np.minimum(min_layer_time_s, given[above])
        kept = lag > LEAST_LAG_S
        count = np.bincount(above[kept], minlength=n)
        offsets = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
        found.append(Lags(offsets, below[kept], lag[kept]))
    return found


def time_left(contours: Contours, begin: Floats, end: Floats) -> Floats:
    """Return how long before each contour the last of what is under it ends, s, (n,).

    Infinite where nothing is under it.
    """
    return _left(*_right_under(contours), begin, end)


def _right_under(contours: Contours) -> tuple[Ints, Int32s]:
    """Return pairs of contours of which the second is right under the first, (k,) each."""
    top = contours.top
    by_top = np.argsort(top, kind="stable").astype(np.int32)
    beads = pack_contours(contours, 0.0)
    offsets, below = printed_over(beads, by_top, top[by_top], contours.height, contours.width)
    return np.repeat(np.arange(len(contours)), np.diff(offsets)), below


def _left(above: Ints, below: Int32s, begin: Floats, end: Floats) -> Floats:
    """Return the time from the last of what is under each contour to its begin, s."""
    given = np.full(len(begin), np.inf)
    np.minimum.at(given, above, begin[above] - end[below])
    return given


def source_times(job: PrintJob, machine: Machine, graph: DependencyGraph) -> tuple[Floats, Floats]:
    """Return when the source's order begins and ends each contour by the clock of `cooled`."""
    visits, travel = _visits(job, machine, graph, Toolpath.as_sliced(len(job.contours)))
    first, last = visits.ends[:, 0], visits.ends[:, 1]
    stood = np.concatenate([_park(machine)[None], last[:-1]])
    travels = [travel_seconds(p, q, travel) for p, q in zip(stood, first, strict=True)]
    end = np.cumsum(np.array(travels) + visits.seconds[0])
    return end - visits.seconds[0], end


def timed_lags_of(lags: Lags, begin: Floats, end: Floats) -> TimedLags:
    """Return the lags as a search keeps them, from `source_times` of at least one contour."""
    printing = end - begin
    travel = (end[-1] - printing.sum()) / len(end)
    return TimedLags.kept_by_source(lags, printing + TRAVEL_SHARE * travel)


def print_times(actions: HeadActions, n: int) -> tuple[Floats, Floats]:
    """Return when each of `n` contours begins and ends in a plan for one head, each (n,)."""
    rows = actions.kind == ActionKind.PRINT
    begin, end = np.zeros(n), np.zeros(n)
    begin[actions.contour[rows]] = actions.begin_s[rows]
    end[actions.contour[rows]] = actions.end_s[rows]
    return begin, end


def _visits(
    job: PrintJob, machine: Machine, graph: DependencyGraph, toolpath: Toolpath
) -> tuple[Visits, Floats]:
    """Return the contours as a toolpath runs them, and what travels take."""
    seconds, nowhere = job_times(job, machine.limits), np.zeros(len(job.contours), np.bool_)
    visits = visits_of(job.contours, graph, seconds[None], nowhere, in_pieces=False)
    ends = np.empty_like(visits.ends)
    ends[toolpath.order] = np.stack(endpoints(job.contours, toolpath), axis=1)
    return visits._replace(ends=ends), np.array(travel_row(job.settings, machine.limits))


def _park(machine: Machine) -> Floats:
    return np.array(machine.heads[0].park, np.float64)


def cooled(
    job: PrintJob, machine: Machine, graph: DependencyGraph, lags: Lags, toolpath: Toolpath
) -> TimedOrder:
    """Return an order near `toolpath` that waits little, with its time.

    Where the next contour is still warm, later ones that can be printed now are
    printed first; if that saves no time on the whole, the order stays as it is.
    """
    visits, travel = _visits(job, machine, graph, toolpath)
    given = (toolpath.order, _park(machine), visits, graph.succ_offsets, graph.succs, lags)
    _, seconds, waited = follow(*given, travel, False)
    as_it_is = TimedOrder(toolpath, float(seconds), float(waited), float(waited))
    if waited <= 0.0:
        return as_it_is
    order, seconds, less = follow(*given, travel, True)
    place = np.empty(len(order), np.int64)
    place[toolpath.order] = np.arange(len(order))
    at = place[order]
    made = Toolpath(order, toolpath.reversed[at], toolpath.entry[at])
    filled = TimedOrder(made, float(seconds), float(less), float(waited))
    return min(as_it_is, filled, key=lambda one: one.seconds)
