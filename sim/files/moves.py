"""The moves of a one-head file against those of its source: beads, order, places, contacts.

Every extrusion of the source once, with its filament and feed, nothing else; in an order that its
barriers allow; and the head, moved through the file, touches nothing printed before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from decmcts.formats.gcode import Motions
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from sim.arrays import Ints
from sim.content.arcs import check_arcs, turns_of
from sim.content.inventory import Segments, compare, match_segments
from sim.content.same_print import check_print
from sim.content.seams import Moved, motions_with
from sim.faults import Fault, Gap, Nearest, Verdict
from sim.files.extent import check_file_extent, check_file_feeds
from sim.files.file_contacts import check_file_material
from sim.files.printed_file import laying_moves, segments_of
from sim.rules.precedence import check_file_epochs
from sim.rules.priming import check_file_priming


@dataclass(frozen=True, slots=True)
class Matched:
    """The beads of a file, and which of the source's each of them is."""

    faults: list[Fault]
    is_other: bool  # another print: nothing else was compared
    moves: int  # of the file
    segments: Segments  # (n,) of the file, in its order
    laid: Ints  # (n,) the moves that lay them
    contour: Ints  # (n,) the source's contour each of them is of, -1: of none
    source_line: Ints  # (n,) where the source lays each of them, -1: nowhere
    warnings: tuple[str, ...] = ()  # contacts that the source makes on the same moves
    beside: Gap | None = None  # least, of the head to beads, from the first contour to the last

    def verdict(self, faults: Sequence[Fault] = (), checked: tuple[str, ...] = ()) -> Verdict:
        """Return the verdict on the file, with more faults; another print has that one alone."""
        if self.is_other:
            return Verdict(tuple(self.faults))
        counts = {"moves": float(self.moves), "segments": float(len(self.segments.ends))}
        nearest = Nearest(beside=self.beside)
        return Verdict((*self.faults, *faults), counts, checked, self.warnings, nearest)


def contours_laid(
    motions: Motions, source: Motions, job: PrintJob, seams: Sequence[Moved] = ()
) -> Ints:
    """Return which of the source's contours each bead of a file is of, in its order; -1: none."""
    source = motions_with(source, job.contours, seams)
    laid, due = laying_moves(motions), laying_moves(source)
    match = match_segments(segments_of(motions, laid), segments_of(source, due))
    contour = np.asarray(source.contour, np.int64)[due]
    return np.where(match >= 0, contour[match] if len(contour) else -1, -1)


def check_moves(
    motions: Motions,
    source: Motions,
    machine: Machine,
    *,
    job: PrintJob | None = None,
    seams: Sequence[Moved] = (),
) -> Matched:
    """Check the moves of a file; whatever judges a file of one head asks here.

    Parameters
    ----------
    job : PrintJob | None
        The source's print; when given, nothing may have moved across its barriers.
    seams : Sequence[Moved]
        Loops of `job` the file enters at another vertex.
    """
    given, turns, moved = source, turns_of(source), {seam.contour for seam in seams}
    if job is not None:
        source = motions_with(source, job.contours, seams)
    laid, due = laying_moves(motions), laying_moves(source)
    ours, theirs = segments_of(motions, laid), segments_of(source, due)
    match = match_segments(ours, theirs)
    contour = np.asarray(source.contour, np.int64)[due]
    printed = np.where(match >= 0, contour[match] if len(contour) else -1, -1)
    lines = np.where(match >= 0, theirs.place[match] if len(theirs.place) else -1, -1)
    if other := check_print(ours, theirs, match, contour):
        return Matched(other, True, len(motions.line), ours, laid, printed, lines)
    faults = compare(ours, theirs, match) + check_arcs(turns_of(motions), turns, moved)
    if job is not None and len(job.contours):
        epoch = np.where(contour >= 0, job.contours.epoch[np.maximum(contour, 0)], -1)
        faults += check_file_epochs(ours.place, match, epoch)
        faults += check_file_priming(job.contours, printed, refills=job.refills)
    faults += check_file_extent(motions, source, machine)
    faults += check_file_feeds(motions, source, machine)
    contours = job.contours if job is not None and len(job.contours) else None
    contacts, warnings, beside = check_file_material(
        motions, given, machine, laid, printed, match, contours
    )
    return Matched(
        faults + contacts, False, len(motions.line), ours, laid, printed, lines, warnings, beside
    )
