"""Loops entered so that a head gives back first what the heads beside it want.

A head gives its room back while it prints a contour, and holds longest the room where the
contour ends. A loop ends where it begins. So where loops may begin anywhere they can be made
to *lean*: all towards one end of the machine, or each towards the end at which its own head
stands.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.engine.lags import Lags
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.seam import SeamEntries
from decmcts.team.engine.problem import TeamProblem, axis_of, build_team_problem
from decmcts.team.engine.resolve import first_policies_s
from decmcts.team.schedule.entries import OrderChoices, agreed_job

Ints = NDArray[np.int32]


def lean(
    job: PrintJob,
    machine: Machine,
    graph: DependencyGraph,
    orders: OrderChoices,
    entry: Ints,
    entries: SeamEntries | None,
    lags: Lags,
) -> Ints:
    """Return where each loop is entered while heads plan: at `entry`, as sliced or leaning, (n,).

    Of these the way is taken with which the first policies reach the shortest makespan. It is
    `entry` where loops have no choice among `entries`, and where heads hold a contour's room to
    its end.
    """
    if entries is None or len(entries.vertices) == len(job.contours):
        return entry
    if machine.release != "point" or len(machine.heads) < 2:
        return entry

    def entered(chosen: Ints) -> TeamProblem:
        return build_team_problem(agreed_job(job, orders, chosen), machine, graph, lags)

    usual = entered(entry)
    others = [np.zeros_like(entry), *_leaning(job, usual, entries)]
    others = [other for other in others if (other != entry).any()]
    makespans = [first_policies_s(usual), *(first_policies_s(entered(other)) for other in others)]
    return (entry, *others)[int(np.argmin(makespans))]


def _leaning(job: PrintJob, problem: TeamProblem, entries: SeamEntries) -> Iterator[Ints]:
    """Yield entries that lean apart, to the low end of the machine, and to the high one."""
    axis, first_is_low = axis_of(problem.machine)
    loop = entries.contour()
    at = job.contours.points[job.contours.offsets[loop] + entries.vertices, axis]
    low = (problem.quantile < 0.5) == first_is_low
    for leans_low in (low, np.ones_like(low), np.zeros_like(low)):
        row = np.lexsort((np.where(leans_low[loop], at, -at), loop))
        yield entries.vertices[row[entries.offsets[:-1]]]
