"""A G-code file judged against the print it was made from, before anyone may run it.

The plan was checked already; this checks what the writer made of it: every
extrusion once, in force what should be, nothing retracted where it is laid
down, the waits of the plan, the way to the end G-code, and no contact on the moves
really written.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.formats.gcode import (
    GcodeDocument,
    Motions,
    ending_faults,
    read_motions,
    read_written,
    same_extrusions,
)
from decmcts.formats.gcode.source_text import load_text
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.plan import ActionKind, HeadActions
from sim.commands import check_commands
from sim.epochs import check_file_epochs
from sim.faults import Fault, FaultKind, Verdict, listed
from sim.filament import check_owed, check_pulled, check_surplus
from sim.file_contacts import check_file_material
from sim.inventory import NO_MATCH, contour_segments, match_segments, places_of
from sim.priming import check_file_priming
from sim.printed_file import laying_moves, segments_of
from sim.seams import Moved, source_with

DWELL_S = 2e-3  # files give dwells in whole milliseconds
SAME_PLACE_MM = 0.02
DWELL = re.compile(rb"^G4 P(\d+)", re.M)


def verify_written(
    path: Path | str,
    job: PrintJob,
    document: GcodeDocument,
    machine: Machine,
    *,
    seams: Sequence[Moved] = (),
    lane: HeadActions | None = None,
) -> Verdict:
    """Check a one-head file against the job and the document it was made from.

    `seams` are the loops that have to begin at another vertex; `lane` is the plan
    the file was made from, whose waits it has to keep.
    Contacts on moves that make the same contact in the source (in its end code,
    say) are the source's own and are not reported.
    """
    try:
        ours, ours_document, motions, ending = read_written(path, document)
    except InputError as error:
        return Verdict((Fault(FaultKind.STATE, f"the file cannot be read back: {error}"),))
    endings = ending_faults(document, ending)
    job, document = source_with(job, document, seams)
    theirs = cache(lambda: _moves_of(document))
    faults = listed(FaultKind.STATE, same_extrusions(job, document, ours, ours_document))
    faults += listed(FaultKind.STATE, endings)
    laid, match = laying_moves(motions), match_job(motions, job)
    source = contour_of(job)
    known = match != NO_MATCH
    epoch = np.asarray(job.contours.epoch, np.int64)[source]
    faults += check_file_epochs(np.asarray(motions.line)[laid], match, epoch)
    printed = np.where(known, source[match], -1)
    faults += check_file_priming(job.contours, printed, refills=job.refills)
    text = load_text(path)
    faults += check_commands(
        text, document, np.asarray(motions.line)[laid[known]], epoch[match[known]]
    )
    places = places_of(contour_segments(job.contours))
    faults += check_owed(
        motions, laid[known], places[match[known]], (places, source), theirs,
        expected=bool(document.owed.any()),
    )  # fmt: skip
    faults += check_pulled(motions, job.settings.retract_mm, theirs)
    faults += check_surplus(motions, theirs)
    faults += check_file_material(motions, match, machine, source=theirs)
    if lane is not None:
        faults += _check_waits(text, motions, laid, lane)
    return Verdict(tuple(faults), {"moves": float(len(motions.line))})


def _check_waits(
    text: bytes, motions: Motions, laid: NDArray[np.int64], lane: HeadActions
) -> list[Fault]:
    """Check that the file stands still wherever the plan waits, as long, before the same bead.

    `laid` are the moves that lay beads, in the file's order.
    """
    line = np.asarray(motions.line)[laid]
    stood: dict[int, float] = {}  # seconds before each laying move
    at, n = 0, 1
    for dwell in DWELL.finditer(text):
        n += text.count(b"\n", at, dwell.start())
        at = dwell.start()
        k = int(np.searchsorted(line, n))
        stood[k] = stood.get(k, 0.0) + int(dwell[1]) / 1000.0
    dwells = [(motions.points[laid[k]], seconds) for k, seconds in stood.items() if k < len(laid)]
    lines, due, used = [], 0.0, 0
    for a in np.flatnonzero(lane.kind != ActionKind.TRAVEL).tolist():
        if lane.kind[a] == ActionKind.WAIT:
            due += float(lane.end_s[a] - lane.begin_s[a])
        elif lane.kind[a] == ActionKind.PRINT and due > 0.0:
            begin = lane.action_path(a)[0]
            left = range(used, len(dwells))
            near = (k for k in left if np.abs(dwells[k][0] - begin).max() < SAME_PLACE_MM)
            found = next(near, None)
            seconds = 0.0 if found is None else dwells[found][1]
            if seconds < due - DWELL_S:
                lines.append(
                    f"waits {seconds:.1f} s before contour {lane.contour[a]}, planned {due:.1f} s"
                )
            if found is not None:
                used = found + 1
            due = 0.0
    return listed(FaultKind.COOLING, lines)


def match_job(motions: Motions, job: PrintJob) -> NDArray[np.int64]:
    """Return for each laying move the segment of the contours it is, or NO_MATCH, (n,)."""
    return match_segments(segments_of(motions), contour_segments(job.contours))


def contour_of(job: PrintJob) -> NDArray[np.int64]:
    """Return the contour of each laid segment, in the order of `contour_segments`."""
    return np.asarray(contour_segments(job.contours).place, np.int64)


def _moves_of(document: GcodeDocument) -> Motions | None:
    """Return the moves of the source; None where it was no G-code file."""
    try:
        return read_motions(document.path)
    except InputError:
        return None
