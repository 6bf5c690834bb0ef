"""The moves of a one-head file against those of its source: beads, order, places, contacts.

Every extrusion of the source once, with its filament and feed, nothing else; in an order that its
barriers allow; and the head, moved through the file, touches nothing printed before.

Start and end code are included.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from decmcts.arrays import Flags, Floats, Ints
from decmcts.formats.gcode import Motions
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from sim.content.arcs import check_arcs, turns_of
from sim.content.inventory import Segments, compare, match_segments
from sim.content.same_print import check_print
from sim.content.seams import Moved, motions_with
from sim.faults import LIMIT, SHOWN, Fault, FaultKind, Gap, Nearest, Verdict, listed
from sim.files.extent import (
    beads_of,
    check_file_extent,
    check_file_feeds,
    laying_moves,
    moves_array,
    moving,
    segments_of,
)
from sim.replay.contacts import (
    NOBODY,
    Meetings,
    Whose,
    broken_pairs,
    source_meetings,
    turned_touching,
)
from sim.replay.material import Allowed, Contact, find_contacts, place_of
from sim.replay.near_misses import NearPrint, UndecidedError
from sim.replay.shapes import Beads, as_material
from sim.rules.order_rules import check_file_priming
from sim.rules.precedence import check_file_epochs


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

    With the source's `job` nothing may have moved across its barriers. `seams` are loops of it
    that the file enters at another vertex.
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
    try:
        contacts, warnings, beside = _check_material(
            motions, given, machine, laid, printed, match, contours
        )
    except UndecidedError as error:
        contacts, warnings, beside = [Fault(FaultKind.HEAD_MATERIAL, str(error))], (), None
    return Matched(
        faults + contacts, False, len(motions.line), ours, laid, printed, lines, warnings, beside
    )


WIPE_MM = 0.02  # a wipe keeps so near to the contour it wipes along
LOOKED_AT = 10 * LIMIT  # contacts that are looked for; what is allowed is none of them
FILE_TOLERANCE_MM = 2e-3  # overlap that counts as touching: files have three decimals


def _check_material(
    motions: Motions, source: Motions, machine: Machine, laid: Ints, contour: Ints, match: Ints,
    contours: Contours | None,
) -> tuple[list[Fault], tuple[str, ...], Gap | None]:  # fmt: skip
    """Move the first head of the machine through the file.

    Contacts between contours are none to report where the source makes them too
    (`sim.replay.contacts`); without its `contours` none is. Those of other moves are warnings where
    the source makes the same move behind the same bead, in its end code for one. Returns faults,
    warnings, and the least gap from the first contour to the last.

    `laid` are the moves that lay material, `contour` and `match` which contour of the source, and
    which of its segments in its order, each of them prints; below 0: none, (n,).

    Raises
    ------
    UndecidedError
        Where contacts are too many to decide.
    """
    if not (np.asarray(motions.contour) >= 0).any():
        return [], (), None
    faults, warnings, beside = list[Fault](), tuple[str, ...](), None
    file = _file_of(motions, machine, laid, contour, match)
    if contours is not None:
        file.contours = contours
        file.meetings = source_meetings(contours, machine, machine.heads[0], FILE_TOLERANCE_MM)
        faults = _check_meetings(file.meetings, contour, match)
    allowed, near = file.allowed(), file.asked_near()
    contacts = file.contacts(machine, allowed, near)
    if (file.whose.own[[c.move for c in contacts]] < 0).any():
        forgiven = _forgiven(file, source)
        own = file.contacts(machine, lambda *at: allowed(*at) | ~forgiven(*at))
        warnings = tuple(file.text(c) for c in own[:SHOWN])
        if (more := len(own) - SHOWN) > 0:
            count = f"over {more}" if len(own) >= LOOKED_AT else str(more)
            warnings += (f"and {count} more like it, as in the source",)
        contacts = file.contacts(machine, lambda *at: allowed(*at) | forgiven(*at))
    if not contacts:
        does = f"line {file.line[near.move]}"
        beside = near.gap(machine, 0, does, "the bead of line", file.beads.label)
    texts = [file.text(c) for c in contacts]
    return faults + listed(FaultKind.HEAD_MATERIAL, texts), warnings, beside


def _forgiven(file: _File, source: Motions) -> Allowed:
    """Return which contacts the source makes too: on the same move, behind the same bead.

    The same move past the same bead makes the same contact, so the source is not searched.
    Linear in the moves of both but for a sort.
    """
    contour, rows = np.asarray(source.contour, np.int64), moving(source)
    rows = rows[contour[rows] < 0]
    ours, theirs = _paths(file.moves), _paths(moves_array(source)[rows])
    _, key = np.unique(np.vstack([theirs, ours]), axis=0, return_inverse=True)
    latest = np.full(len(rows) + len(ours), NOBODY)
    np.maximum.at(latest, key[: len(rows)], rows)
    until = np.where(file.whose.own < 0, latest[key[len(rows) :]], NOBODY)
    laid = np.flatnonzero(contour >= 0)
    printed = np.full(
        max(int(contour.max(initial=0)), int(file.of_bead.max(initial=0))) + 2, len(contour)
    )
    printed[contour[laid]] = laid

    def forgiven(move: Ints, bead: Ints, depth: Floats) -> Flags:
        return np.asarray(printed[file.of_bead[bead]] < until[move])

    return forgiven


def _paths(moves: Floats) -> Ints:
    """Return what makes two moves the same, (m, 6): both ends, or how low it goes upright."""
    ends = np.round(moves * 1000.0).astype(np.int64)
    upright = (ends[:, 0] == ends[:, 3]) & (ends[:, 1] == ends[:, 4])
    low = np.minimum(ends[:, 2], ends[:, 5])
    for column in (2, 5):
        ends[:, column] = np.where(upright, low, ends[:, column])
    return ends


@dataclass(slots=True)
class _File:
    """Moves and beads of a file, and whose each of them is; `NOBODY`'s where not known."""

    moves: Floats  # (m, 6)
    beads: Beads
    line: Ints  # (m,)
    whose: Whose
    of_bead: Ints  # (n,) contour of each bead
    contours: Contours | None = None
    meetings: Meetings | None = None

    def contacts(
        self, machine: Machine, allowed: Allowed, near: NearPrint | None = None
    ) -> list[Contact]:
        """Return where the head meets a bead, but for what is allowed; `LOOKED_AT` at most.

        `near` is filled in where given.
        """
        return find_contacts(
            self.moves, self.beads, machine.heads[0], clearance_mm=machine.clearance_mm,
            tolerance_mm=FILE_TOLERANCE_MM, limit=LOOKED_AT, allowed=allowed, near=near,
        )  # fmt: skip

    def asked_near(self) -> NearPrint:
        """Return the question how near the head comes from the first contour to the last."""
        prints = np.flatnonzero(self.whose.own >= 0)
        near = NearPrint(int(prints[0]), int(prints[-1]) + 1) if len(prints) else NearPrint(end=0)
        if self.meetings is not None and len(self.meetings.key):
            near.touching, near.n = self.meetings.key, self.meetings.n
            near.contour, whose = self.of_bead, self.whose
            around = [whose.own, whose.of_move(whose.last), whose.of_move(whose.next)]
            near.whose = np.stack(around, axis=1)
        return near

    def allowed(self) -> Allowed:
        """Return which contacts the contours of the source make too."""
        meetings, whose = self.meetings, self.whose
        if meetings is None:
            return lambda move, bead, depth: np.zeros(len(move), np.bool_)
        before, wipes = whose.of_move(whose.last), dict[int, bool]()

        def allowed(move: Ints, bead: Ints, depth: Floats) -> Flags:
            met = whose.allow(meetings, move, self.of_bead[bead], depth)
            wiped = ~met & meetings.allow(before[move], self.of_bead[bead], depth)
            for k in np.flatnonzero(wiped & (whose.own[move] < 0)).tolist():
                if (row := int(move[k])) not in wipes:
                    wipes[row] = self._is_wipe(row, int(before[row]))
                met[k] = wipes[row]
            return met

        return allowed

    def _is_wipe(self, move: int, before: int) -> bool:
        """Tell whether a move wipes along the contour `before` it."""
        assert self.contours is not None
        start, end = self.moves[move, :2], self.moves[move, 3:5]
        path = shapely.linestrings(self.contours.polyline(before)[:, :2])
        steps = start + np.linspace(0.0, 1.0, 9)[:, None] * (end - start)
        return bool((shapely.distance(shapely.points(steps), path) < WIPE_MM).all())

    def text(self, c: Contact) -> str:
        """Return the words for a contact."""
        return (
            f"line {self.line[c.move]}: {c.part} meets the bead of line "
            f"{self.beads.label[c.bead]}, {c.depth_mm:.3f} mm too high, near "
            f"{place_of(self.moves[c.move])}"
        )


def _file_of(motions: Motions, machine: Machine, laid: Ints, contour: Ints, match: Ints) -> _File:
    rows = moving(motions)
    beads = beads_of(motions, laid, match)
    beads = replace(beads, since=np.searchsorted(rows, beads.since))
    every = np.full(len(motions.line), NOBODY)
    every[laid] = np.maximum(contour, NOBODY)
    moves = moves_array(motions)[rows]
    return _File(
        moves, as_material(beads, machine, FILE_TOLERANCE_MM),
        np.asarray(motions.line, np.int64)[rows], Whose.of(moves, every[rows]),
        every[laid[np.asarray(motions.contour)[laid] >= 0]],
    )  # fmt: skip


def _check_meetings(meetings: Meetings, contour: Ints, match: Ints) -> list[Fault]:
    """Check that contours that touch in the source keep their order and run as sliced."""
    n = meetings.n
    laid = np.flatnonzero(contour >= 0)
    contour = contour[laid]
    first, last = np.full(n, len(laid)), np.full(n, -1)
    np.minimum.at(first, contour, np.arange(len(laid)))
    np.maximum.at(last, contour, np.arange(len(laid)))
    nozzle, bead = meetings.ordered.T
    broken = last[bead] >= first[nozzle]
    touching = np.zeros(n, np.bool_)
    touching[meetings.ordered.ravel()] = True
    same = (contour[1:] == contour[:-1]) & (np.diff(match[laid]) <= 0)
    return [
        *broken_pairs(bead[broken], nozzle[broken]),
        *turned_touching(np.unique(contour[1:][same]), touching),
    ]
