"""A G-code file judged against the print it was made from, before anyone may run it.

The plan was checked already; this checks what the writer made of it. Every extrusion occurs
once, under the state and with the filament retracted as in the source. The file waits where
the plan waits, it hands over to the end G-code as the source does, and no written move touches
the print.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
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
from decmcts.formats.gcode.text.source_text import load_text
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.plan import ActionKind, HeadActions
from sim.content.arcs import check_arcs, turns_of, turns_of_print
from sim.content.inventory import NO_MATCH, Segments, contour_segments, match_segments, places_of
from sim.content.seams import Moved, source_with
from sim.faults import Fault, FaultKind, Verdict, listed
from sim.files.commands import check_commands
from sim.files.filament import check_owed, check_pulled, check_surplus
from sim.files.file_contacts import check_file_material
from sim.files.printed_file import laying_moves, segments_of
from sim.rules.epochs import check_file_epochs
from sim.rules.priming import check_file_priming

DWELL_S = 2e-3  # files give dwells in whole milliseconds
SAME_PLACE_MM = 0.02
DWELL = re.compile(rb"^G4 P(\d+)", re.M)


@dataclass(frozen=True, slots=True)
class Written:
    """A file as it was read back, beside what it was made from."""

    text: bytes
    motions: Motions
    job: PrintJob  # what it was made from, seams as they had to move
    document: GcodeDocument
    laid: NDArray[np.int64]  # (n,) moves that lay beads, in the file's order
    match: NDArray[np.int64]  # (n,) the segment of the job each of them is, or NO_MATCH
    segments: Segments  # (m,) of the job
    faults: tuple[Fault, ...]  # found while reading: extrusions or an ending unlike the source's


def verify_written(
    path: Path | str,
    job: PrintJob,
    document: GcodeDocument,
    machine: Machine,
    *,
    seams: Sequence[Moved] = (),
    actions: HeadActions | None = None,
) -> Verdict:
    """Check a one-head file against the job and the document it was made from.

    `seams` are the loops that have to begin at another vertex; `actions` is the plan
    the file was made from, whose waits it has to keep.
    Contacts on moves that make the same contact in the source (in its end code,
    say) are the source's own and are not reported.
    """
    try:
        written = _read_back(path, job, document, seams)
    except InputError as error:
        return Verdict((_unreadable(error),))
    theirs = cache(lambda: _moves_of(document))
    faults = _check_state(written, theirs)
    faults += _check_order(written)
    faults += check_file_material(written.motions, written.match, machine, source=theirs)
    if actions is not None:
        faults += _check_waits(written.text, written.motions, written.laid, actions)
    return Verdict(tuple(faults), {"moves": float(len(written.motions.line))})


def check_state(
    path: Path | str,
    job: PrintJob,
    document: GcodeDocument,
    *,
    seams: Sequence[Moved] = (),
    plate: int | None = None,
) -> list[Fault]:
    """Check only what a file commands, and the state and filament where it prints.

    For files whose moves are judged already (`sim.verify.verify_motions`); of a .gcode.3mf those
    of a `plate`.
    """
    try:
        written = _read_back(path, job, document, seams, plate)
    except InputError as error:
        return [_unreadable(error)]
    return _check_state(written, cache(lambda: _moves_of(document)))


def _unreadable(error: InputError) -> Fault:
    return Fault(FaultKind.STATE, f"the file cannot be read back: {error}")


def _read_back(
    path: Path | str,
    job: PrintJob,
    document: GcodeDocument,
    seams: Sequence[Moved],
    plate: int | None = None,
) -> Written:
    """Read a file that was made from a document; raises InputError where that fails."""
    ours, ours_document, motions, ending = read_written(path, document, plate)
    endings = ending_faults(document, ending)
    arcs = check_arcs(
        turns_of(motions, all_moves=False), turns_of_print(job, document),
        {seam.contour for seam in seams},
    )  # fmt: skip
    job, document = source_with(job, document, seams)
    differences = same_extrusions(job, document, ours, ours_document)
    faults = listed(FaultKind.STATE, differences) + listed(FaultKind.STATE, endings) + arcs
    segments = contour_segments(job.contours)
    return Written(
        load_text(path, plate), motions, job, document, laying_moves(motions),
        match_segments(segments_of(motions), segments), segments, tuple(faults),
    )  # fmt: skip


def _check_state(written: Written, theirs: Callable[[], Motions | None]) -> list[Fault]:
    """Check the commands of a file, and its filament, against the source's."""
    motions, job, document = written.motions, written.job, written.document
    known = written.match != NO_MATCH
    laid, match = written.laid[known], written.match[known]
    source = np.asarray(written.segments.place, np.int64)
    epoch = np.asarray(job.contours.epoch, np.int64)[source[match]]
    line = np.asarray(motions.line)[laid]
    places = places_of(written.segments)
    return [
        *written.faults,
        *check_commands(written.text, document, line, epoch),
        *check_owed(
            motions, laid, places[match], (places, source), theirs,
            expected=bool(document.owed.any()),
        ),
        *check_pulled(motions, job.settings.retract_mm, theirs),
        *check_surplus(motions, theirs),
    ]  # fmt: skip


def _check_order(written: Written) -> list[Fault]:
    """Check that nothing moved across a barrier, and that what primes the nozzle stays first."""
    contours, match = written.job.contours, written.match
    source = np.asarray(written.segments.place, np.int64)
    epoch = np.asarray(contours.epoch, np.int64)[source]
    printed = np.where(match != NO_MATCH, source[match], -1)
    return [
        *check_file_epochs(np.asarray(written.motions.line)[written.laid], match, epoch),
        *check_file_priming(contours, printed, refills=written.job.refills),
    ]


def _check_waits(
    text: bytes, motions: Motions, laid: NDArray[np.int64], actions: HeadActions
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
    for a in np.flatnonzero(actions.kind != ActionKind.TRAVEL).tolist():
        if actions.kind[a] == ActionKind.WAIT:
            due += float(actions.end_s[a] - actions.begin_s[a])
        elif actions.kind[a] == ActionKind.PRINT and due > 0.0:
            begin = actions.action_path(a)[0]
            left = range(used, len(dwells))
            near = (k for k in left if np.abs(dwells[k][0] - begin).max() < SAME_PLACE_MM)
            found = next(near, None)
            seconds = 0.0 if found is None else dwells[found][1]
            if seconds < due - DWELL_S:
                lines.append(
                    f"waits {seconds:.1f} s before contour {actions.contour[a]}, "
                    f"planned {due:.1f} s"
                )
            if found is not None:
                used = found + 1
            due = 0.0
    return listed(FaultKind.COOLING, lines)


def _moves_of(document: GcodeDocument) -> Motions | None:
    """Return the moves of the source; None where it was no G-code file."""
    try:
        return read_motions(document.path, document.plate)
    except InputError:
        return None
