"""All order constraints of a print on a machine: the one place they are put together.

Planners and agents build their graph here, so that no rule is on in one command
and off in another.
"""

from __future__ import annotations

from typing import Literal

from decmcts.feasibility.build import build_graph
from decmcts.feasibility.graph import DependencyGraph
from decmcts.feasibility.lead import limit_lead
from decmcts.feasibility.priming import prime_first
from decmcts.print.job import PrintJob
from decmcts.print.loops import close_gaps
from decmcts.print.machine import Machine


def order_rules(
    job: PrintJob,
    machine: Machine,
    *,
    process_order: Literal["keep", "free"] = "keep",
    quality: bool = False,
    free_seams: bool = False,
    max_layers_ahead: int | None = None,
) -> DependencyGraph:
    """Return what must come before what when `job` is printed on `machine`.

    Parameters
    ----------
    process_order, quality
        As in `decmcts.feasibility.build.build_graph`.
    free_seams : bool
        Whether loops may begin anywhere, so that they count as closed.
    max_layers_ahead : int | None
        As `layers` in `decmcts.feasibility.lead.limit_lead`; None: no limit.

    Raises
    ------
    InputError
        If the source itself cannot be printed in its own order with this machine.
    """
    graph = build_graph(
        close_gaps(job.contours) if free_seams else job.contours,
        machine.heads,
        clearance_mm=machine.clearance_mm,
        bead_width=machine.bead_width,
        process_order=process_order,
        quality=quality,
    )
    graph = prime_first(graph, job)
    if max_layers_ahead is not None:
        graph = limit_lead(graph, job.contours.layer, layers=max_layers_ahead)
    return graph
