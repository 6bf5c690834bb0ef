"""Head against material on the moves of a one-head G-code file, start and end code included."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely

from decmcts.formats.gcode import Motions
from decmcts.print.contours import Contours
from decmcts.print.machine import Machine
from sim.arrays import Flags, Floats, Ints
from sim.faults import LIMIT, SHOWN, Fault, FaultKind, Gap, Nearest, listed
from sim.files.printed_file import beads_of, moves_array, moving
from sim.replay.contacts import (
    AT_MM,
    NOBODY,
    Meetings,
    broken_pairs,
    source_meetings,
    turned_touching,
)
from sim.replay.material import Allowed, Contact, find_contacts, or_undecided, place_of
from sim.replay.near_misses import NearPrint
from sim.replay.shapes import Beads, as_material

WIPE_MM = 0.02  # a wipe keeps so near to the contour it wipes along
LOOKED_AT = 10 * LIMIT  # contacts that are looked for; what is allowed is none of them
FILE_TOLERANCE_MM = 2e-3  # overlap that counts as touching: files have three decimals


@dataclass(frozen=True, slots=True)
class Printed:
    """What a file prints, in terms of its source."""

    laid: Ints  # (n,) the moves that lay material
    contour: Ints  # (n,) of each laying move, which contour of the source it prints; below 0: none
    match: Ints  # (n,) which of the source's segments, in the source's order
    contours: Contours | None = None  # the source's; None: no contact between them is its own


@dataclass(slots=True)
class Met:
    """What came of moving the head through a file, but for its faults."""

    warnings: tuple[str, ...] = ()
    beside: Gap | None = None  # from its first contour to its last

    @property
    def nearest(self) -> Nearest:
        """Return the least gaps of a verdict."""
        return Nearest(beside=self.beside)


def check_file_material(
    motions: Motions, printed: Printed, machine: Machine, source: Motions
) -> tuple[list[Fault], Met]:
    """Move the first head of the machine through the file.

    Contacts between contours are none to report where the source makes them too
    (`sim.replay.contacts`). Those of other moves are warnings where the source makes the same
    move behind the same bead, in its end code for one.
    """
    if not (np.asarray(motions.contour) >= 0).any():
        return [], Met()
    met = Met()
    faults = or_undecided(lambda: _file_faults(motions, printed, machine, source, met))
    return faults, met


def _file_faults(
    motions: Motions, printed: Printed, machine: Machine, source: Motions, met: Met
) -> list[Fault]:
    """Return the faults; fills in `met`."""
    faults: list[Fault] = []
    file = _file_of(motions, printed, machine)
    if printed.contours is not None:
        file.meetings = source_meetings(
            printed.contours, machine, machine.heads[0], FILE_TOLERANCE_MM
        )
        faults = _check_meetings(file.meetings, printed)
    allowed, near = file.allowed(), file.asked_near()
    contacts = file.contacts(machine, allowed, near)
    if (file.own[[c.move for c in contacts]] < 0).any():
        forgiven = _forgiven(file, source)
        met.warnings = _warnings(
            file, file.contacts(machine, lambda *at: allowed(*at) | ~forgiven(*at))
        )
        contacts = file.contacts(machine, lambda *at: allowed(*at) | forgiven(*at))
    if not contacts:
        does = f"line {file.line[near.move]}"
        met.beside = near.gap(machine, 0, does, "the bead of line", file.beads.label)
    return faults + listed(FaultKind.HEAD_MATERIAL, [file.text(c) for c in contacts])


def _warnings(file: _File, contacts: list[Contact]) -> tuple[str, ...]:
    lines = [file.text(c) for c in contacts[:SHOWN]]
    if (more := len(contacts) - SHOWN) > 0:
        count = f"over {more}" if len(contacts) >= LOOKED_AT else str(more)
        lines.append(f"and {count} more like it, as in the source")
    return tuple(lines)


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
    until = np.where(file.own < 0, latest[key[len(rows) :]], NOBODY)
    laid = np.flatnonzero(contour >= 0)
    printed = np.full(
        max(int(contour.max(initial=0)), int(file.whose.max(initial=0))) + 2, len(contour)
    )
    printed[contour[laid]] = laid

    def forgiven(move: Ints, bead: Ints, depth: Floats) -> Flags:
        return np.asarray(printed[file.whose[bead]] < until[move])

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
    own: Ints  # (m,) contour that a move prints
    before: Ints  # (m,) contour printed last before it
    after: Ints  # (m,) and next after it
    whose: Ints  # (n,) contour of each bead
    last: Ints  # (m,) move that printed last before it, -1: none
    next: Ints  # (m,) and the one that prints next, m: none
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
        prints = np.flatnonzero(self.own >= 0)
        near = NearPrint(int(prints[0]), int(prints[-1]) + 1) if len(prints) else NearPrint(end=0)
        if self.meetings is not None and len(self.meetings.key):
            near.touching, near.n, near.contour = self.meetings.key, self.meetings.n, self.whose
            near.whose = np.stack([self.own, self.before, self.after], axis=1)
        return near

    def allowed(self) -> Allowed:
        """Return which contacts the contours of the source make too."""
        meetings = self.meetings
        if meetings is None:
            return lambda move, bead, depth: np.zeros(len(move), np.bool_)
        left = self._upright(self.before, self.last, 3)
        due = self._upright(self.after, self.next, 0)
        wipes: dict[int, bool] = {}

        def allowed(move: Ints, bead: Ints, depth: Floats) -> Flags:
            met = meetings.allow(self.own[move], self.whose[bead], depth)
            for contour in (left, due):
                met |= meetings.allow(contour[move], self.whose[bead], depth)
            wiped = ~met & meetings.allow(self.before[move], self.whose[bead], depth)
            for k in np.flatnonzero(wiped & (self.own[move] < 0)).tolist():
                if (row := int(move[k])) not in wipes:
                    wipes[row] = self._is_wipe(row)
                met[k] = wipes[row]
            return met

        return allowed

    def _upright(self, contour: Ints, at: Ints, column: int) -> Ints:
        """Return `contour` for moves straight up or down where the move `at` ends or begins."""
        known = np.clip(at, 0, len(self.moves) - 1)
        point = self.moves[known, column : column + 3]
        near = np.abs(self.moves - np.hstack([point, point]))[:, [0, 1, 3, 4]].max(axis=1) < AT_MM
        above = np.minimum(self.moves[:, 2], self.moves[:, 5]) >= point[:, 2] - AT_MM
        return np.where(near & above & (at == known), contour, NOBODY)

    def _is_wipe(self, move: int) -> bool:
        """Tell whether a move wipes along the contour printed before it."""
        assert self.contours is not None
        start, end = self.moves[move, :2], self.moves[move, 3:5]
        path = shapely.linestrings(self.contours.polyline(int(self.before[move]))[:, :2])
        steps = start + np.linspace(0.0, 1.0, 9)[:, None] * (end - start)
        return bool((shapely.distance(shapely.points(steps), path) < WIPE_MM).all())

    def text(self, c: Contact) -> str:
        """Return the words for a contact."""
        return (
            f"line {self.line[c.move]}: {c.part} meets the bead of line "
            f"{self.beads.label[c.bead]}, {c.depth_mm:.3f} mm too high, near "
            f"{place_of(self.moves[c.move])}"
        )


def _file_of(motions: Motions, printed: Printed, machine: Machine) -> _File:
    rows, laid = moving(motions), printed.laid
    beads = beads_of(motions, laid, printed.match)
    beads = replace(beads, since=np.searchsorted(rows, beads.since))
    every = np.full(len(motions.line), NOBODY)
    every[laid] = np.maximum(printed.contour, NOBODY)
    own = every[rows]
    count = np.arange(len(own))
    last = np.maximum.accumulate(np.where(own >= 0, count, -1))
    due = np.minimum.accumulate(np.where(own >= 0, count, len(own))[::-1])[::-1]
    return _File(
        moves_array(motions)[rows],
        as_material(beads, machine, FILE_TOLERANCE_MM),
        np.asarray(motions.line, np.int64)[rows],
        own,
        np.where(last >= 0, own[last], NOBODY),
        np.where(due < len(own), own[np.minimum(due, len(own) - 1)], NOBODY),
        every[laid[np.asarray(motions.contour)[laid] >= 0]],
        last,
        due,
        printed.contours,
    )


def _check_meetings(meetings: Meetings, printed: Printed) -> list[Fault]:
    """Check that contours that touch in the source keep their order and run as sliced."""
    n = meetings.n
    laid = np.flatnonzero(printed.contour >= 0)
    contour = printed.contour[laid]
    first, last = np.full(n, len(laid)), np.full(n, -1)
    np.minimum.at(first, contour, np.arange(len(laid)))
    np.maximum.at(last, contour, np.arange(len(laid)))
    nozzle, bead = meetings.ordered.T
    broken = last[bead] >= first[nozzle]
    touching = np.zeros(n, np.bool_)
    touching[meetings.ordered.ravel()] = True
    same = (contour[1:] == contour[:-1]) & (np.diff(printed.match[laid]) <= 0)
    return [
        *broken_pairs(bead[broken], nozzle[broken]),
        *turned_touching(np.unique(contour[1:][same]), touching),
    ]
