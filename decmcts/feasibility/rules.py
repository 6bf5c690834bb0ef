"""All order constraints of a print on a machine: the one place they are put together.

Planners and agents build their graph here, so that no rule is on in one command
and off in another.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from decmcts.feasibility.build import build_graph
from decmcts.feasibility.contacts import Contacts, contacts_of
from decmcts.feasibility.graph import DependencyGraph
from decmcts.feasibility.lead import limit_lead
from decmcts.feasibility.priming import prime_first
from decmcts.print.contours import Contours
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
    contacts: Contacts | None = None,
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
    contacts : Contacts | None
        What `contacts_between` returned; None: they are found here.

    Raises
    ------
    CollisionError
        If the source itself cannot be printed in its own order with this machine.
    """
    graph = build_graph(
        _material(job, free_seams),
        machine.heads,
        clearance_mm=machine.clearance_mm,
        bead_width=machine.bead_width,
        process_order=process_order,
        quality=quality,
        contacts=contacts,
    )
    graph = prime_first(graph, job)
    if max_layers_ahead is not None:
        graph = limit_lead(graph, job.contours.layer, layers=max_layers_ahead)
    return graph


def contacts_between(job: PrintJob, machine: Machine, *, free_seams: bool = False) -> Contacts:
    """Return the contacts of head and beads in the order of the job's contours.

    Raises
    ------
    CollisionError
        If one of them is deeper than contacts may be.
    """
    return contacts_of(_material(job, free_seams), machine)


def with_contacts(job: PrintJob, contacts: Contacts) -> PrintJob:
    """Return the job with what must run as sliced never reversed, and a note on the contacts."""
    if not len(contacts):
        return job
    reversible = job.contours.reversible.copy()
    reversible[contacts.as_sliced] = False
    contours = replace(job.contours, reversible=reversible)
    return replace(job, contours=contours, notes=(*job.notes, contacts.note()))


def _material(job: PrintJob, free_seams: bool) -> Contours:
    return close_gaps(job.contours) if free_seams else job.contours
