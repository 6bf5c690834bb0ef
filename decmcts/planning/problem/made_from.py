"""Whether a source is the print that a plan was made of."""

from __future__ import annotations

import numpy as np

from decmcts.formats.gcode import GcodeDocument
from decmcts.print.job import PrintJob
from decmcts.print.plan import PlanDocument
from sim.content.pieces import epochs_of_source, parted_source
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
