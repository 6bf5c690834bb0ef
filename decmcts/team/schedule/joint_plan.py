"""From one toolpath per head to an exact plan that is safe for every timing.

Safe means rules J1-J5 of docs/definitions.md.

`decmcts.team.engine.order` decides who waits for whom; here every action gets its
path, checked against whatever may be printed by then, and its nominal times.
One head is a joint plan of one: same code. No search here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.detours import Detours
from decmcts.print.job import PrintJob
from decmcts.print.lags_kernels import Lags, no_lags
from decmcts.print.loops import enter_at
from decmcts.print.machine import Machine
from decmcts.print.plan import JointPlan
from decmcts.print.toolpath import Toolpath, entries_by_contour
from decmcts.print.walls import walls_for
from decmcts.team.engine.alone import hand_over
from decmcts.team.engine.order import order_of_job, require_complete
from decmcts.team.engine.space import build_space, fleet_of
from decmcts.team.schedule.actions import join_actions
from decmcts.team.schedule.travels import unit_travels


def schedule(
    job: PrintJob,
    machine: Machine,
    graph: DependencyGraph,
    toolpaths: Sequence[Toolpath],
    *,
    lags: Lags | None = None,
    detours: Detours | None = None,
) -> JointPlan:
    """Make the exact plan in which each head prints its toolpath in order.

    Parameters
    ----------
    job, machine, graph
        The print, the printer and the dependency graph for it.
    toolpaths : Sequence[Toolpath]
        One per head of the machine, in the machine's order; together every
        contour once. A head may get none. If all but one get none, that one is
        an order for everything: contours its head can not print go to one that can.
    lags : Lags | None
        How long what is printed over must cool: heads rest where nothing else takes that
        long, to a quarter of a second. None: nothing has to.
    detours : Detours | None
        The paths of a single head's travels round outer walls. None: they go straight.

    Returns
    -------
    JointPlan
        Satisfies J1-J5 of docs/definitions.md.

    Raises
    ------
    InputError
        A contour is missing, doubled, out of every head's reach or given to a
        head that can not print it, or the sequences contradict the precedence.
    """
    space = build_space(job, machine)
    toolpaths = hand_over(toolpaths, space.eligible)
    require_complete(job, machine, space, toolpaths)
    entry = entries_by_contour(toolpaths, len(job.contours))
    entered = enter_at(job.contours, entry)
    fleet = fleet_of(job, machine)
    cooling = no_lags(len(job.contours)) if lags is None else lags
    order = order_of_job(job, graph, machine, fleet, entered, toolpaths, cooling)
    running = replace(job, contours=entered, acceleration=None)
    travels = unit_travels(running, machine, order, space, walls_for(job), detours)
    return join_actions(job, machine, order, entered, travels, toolpaths, cooling)
