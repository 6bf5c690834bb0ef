"""Whether a source is the print that a plan was made of, and in which reading of it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from decmcts.errors import InputError
from decmcts.formats.gcode import GcodeDocument
from decmcts.planning.events import Report, unheard
from decmcts.planning.options import Freedom, ProcessOrder, Rules
from decmcts.planning.problem.fewer_changes import with_fewer_changes
from decmcts.planning.problem.layer_by_layer import safe_problem
from decmcts.planning.problem.own_tools import one_tool_each, towerless
from decmcts.planning.problem.source import Source
from decmcts.print.job import PrintJob
from decmcts.print.plan import PlanDocument
from sim.content.pieces import epochs_of_source, parted_source
from sim.files.written import read_without_tower
from sim.heads.changes import as_planned


def is_made_from(document: PlanDocument, job: PrintJob, text: GcodeDocument) -> bool:
    """Tell whether a source is the print of a plan, cut or not.

    Changes of tools that the plan has not are none of the source either.
    """
    ours, theirs = document.contours, job.contours
    cut = "none" if document.rules is None else document.rules.cut
    if ours.of is None:
        same = np.array_equal(ours.offsets, theirs.offsets)
        same = same and np.array_equal(ours.points, theirs.points)
        same = same and np.array_equal(ours.extrusion, theirs.extrusion)
        same = same and np.array_equal(ours.tool, theirs.tool)
    else:
        same = len(theirs) == int(ours.sources.max(initial=-1)) + 1
        if same:
            as_cut, _ = as_planned(epochs_of_source(ours), document.machine, job, text)
            same = not parted_source(ours, as_cut, cut).faults
    return bool(same)


def source_of(document: PlanDocument, named: Source) -> Source:
    """Return a source as a plan was made of it.

    Without its wipe tower if the plan has none; in a safe order where the source's own is none;
    with as few changes of tools. Raises InputError where it is not the print of the plan.
    """
    if (made := _as_made(document, named)) is not None:
        return made
    with suppress(InputError):
        found = towerless(named)
        if is_made_from(document, found.job, found.document):
            return found
    raise InputError(
        f"the source is not the print of this plan ({len(named.job.contours)} contours; the plan "
        f"has {_count(document)})",
        advice="name the file that was planned, unchanged",
    )


def as_planned_anew(document: PlanDocument, named: Source) -> Source:
    """Return a source in the order that a plan was made of where that is another, else as it is.

    That is layer by layer, or with fewer changes of tools. As the judge reads it where the plan
    has no wipe tower, which heads with a tool each do without.
    """
    made = _as_made(document, named)
    if made is None and one_tool_each(named.machine, named.job.contours):
        job, text = read_without_tower(named.document, named.plate)
        made = _as_made(document, replace(named, job=job, document=text, towerless=True))
    return made or named


def _as_made(document: PlanDocument, named: Source) -> Source | None:
    """Return what a plan was made of: a source as it is, safe, or with fewer changes; else None."""
    if is_made_from(document, named.job, named.document):
        return named
    if len(named.job.contours) == _count(document):
        for reading in (_safe, with_fewer_changes):
            with suppress(InputError):
                found = reading(named, rules_of(document), unheard)
                if found is not named and is_made_from(document, found.job, found.document):
                    return found
    return None


def _safe(named: Source, rules: Rules, report: Report) -> Source:
    """Return a source layer by layer where its own order is not safe."""
    return safe_problem(named, rules, report).source


def _count(document: PlanDocument) -> int:
    """Return how many contours of its source a plan has."""
    return len(np.unique(document.contours.sources))


def rules_of(document: PlanDocument) -> Rules:
    """Return the rules a plan was made by."""
    made = document.rules
    if made is None:
        return Rules()
    return Rules(
        ProcessOrder(made.process_order), made.quality, document.min_layer_time_s,
        made.max_layers_ahead, Freedom(made.freedom),
    )  # fmt: skip
