"""Loops entered so that a head releases first what the heads beside it want.

A head releases its reserved space while it prints a contour, and holds longest the space where
the contour ends. A loop ends where it begins. So where loops may begin anywhere their entries
can be *biased*: all towards one end of the machine, or each towards the end at which its own
head stands.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.job import PrintJob
from decmcts.print.kinematics import line_up
from decmcts.print.lags_kernels import Lags
from decmcts.print.machine import Machine
from decmcts.print.seam import SeamEntries
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.resolve import first_policies_s
from decmcts.team.schedule.entries import OrderChoices, agreed_job

Ints = NDArray[np.int32]


def biased_entries(
    job: PrintJob,
    machine: Machine,
    graph: DependencyGraph,
    orders: OrderChoices,
    entry: Ints,
    entries: SeamEntries | None,
    lags: Lags,
) -> Ints:
    """Return where each loop is entered while heads plan: at `entry`, as sliced or biased, (n,).

    Of these the entries are taken with which the first policies reach the shortest makespan. It is
    `entry` where loops have no choice among `entries`, and where heads hold a contour's space to
    its end.
    """
    if entries is None or len(entries.vertices) == len(job.contours):
        return entry
    if machine.release != "point" or len(machine.heads) < 2:
        return entry

    def entered(chosen: Ints) -> TeamProblem:
        return build_team_problem(agreed_job(job, orders, chosen), machine, graph, lags)

    usual = entered(entry)
    others = [np.zeros_like(entry), *_biased(job, usual, entries)]
    others = [other for other in others if (other != entry).any()]
    makespans = [first_policies_s(usual), *(first_policies_s(entered(other)) for other in others)]
    return (entry, *others)[int(np.argmin(makespans))]


def _biased(job: PrintJob, problem: TeamProblem, entries: SeamEntries) -> Iterator[Ints]:
    """Yield entries biased apart, to the low end of the machine, and to the high one."""
    axis, _ = line_up(problem.machine)
    loop = entries.contour()
    at = job.contours.points[job.contours.offsets[loop] + entries.vertices, axis]
    low = problem.quantile < 0.5
    for towards_low in (low, np.ones_like(low), np.zeros_like(low)):
        row = np.lexsort((np.where(towards_low[loop], at, -at), loop))
        yield entries.vertices[row[entries.offsets[:-1]]]
