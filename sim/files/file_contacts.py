"""Head against material on the moves of a one-head G-code file, start and end code included."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray

from decmcts.formats.gcode import Motions
from decmcts.print.contours import Contours
from decmcts.print.machine import Machine
from sim.faults import LIMIT, SHOWN, Fault, FaultKind, listed
from sim.files.printed_file import beads_of, laying_moves, moves_array, moving
from sim.replay.contacts import (
    AT_MM,
    NOBODY,
    Meetings,
    broken_pairs,
    source_meetings,
    turned_touching,
)
from sim.replay.material import (
    Allowed,
    Beads,
    Contact,
    as_material,
    find_contacts,
    or_undecided,
    over_tip,
    place_of,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

WIPE_MM = 0.02  # a wipe keeps so near to the contour it wipes along
FILE_TOLERANCE_MM = 2e-3  # overlap that counts as touching: files have three decimals


@dataclass(frozen=True, slots=True)
class Printed:
    """What a file prints, in terms of its source."""

    contours: Contours  # the source's, as it numbers them
    contour: Ints  # (n,) of each laying move, which of them it prints; below 0: none
    match: Ints  # (n,) which of the source's segments, in the source's order


def check_file_material(
    motions: Motions,
    match: Ints,
    machine: Machine,
    *,
    printed: Printed | None = None,
    source: Callable[[], Motions | None] = lambda: None,
) -> tuple[list[Fault], tuple[str, ...]]:
    """Move the first head of the machine through the file; return faults and warnings.

    Contacts between contours are none to report where the source makes them too
    (`sim.replay.contacts`). Those of other moves that the source makes too, in its end code for
    one, are warnings.

    Parameters
    ----------
    match : (n,) for each laying move the place of its segment in the source
    printed : Printed | None
        None: no contact between contours is the source's.
    source
        Returns the source's moves; called only when there are contacts.
    """
    if not (np.asarray(motions.contour) >= 0).any():
        return [], ()
    said: list[str] = []
    faults = or_undecided(lambda: _file_faults(motions, match, machine, printed, source, said))
    return faults, tuple(said)


def _file_faults(
    motions: Motions,
    match: Ints,
    machine: Machine,
    printed: Printed | None,
    source: Callable[[], Motions | None],
    said: list[str],
) -> list[Fault]:
    faults: list[Fault] = []
    file = _file_of(motions, match, machine, printed)
    if printed is not None:
        file.meetings = source_meetings(
            printed.contours, machine, machine.heads[0], FILE_TOLERANCE_MM
        )
        faults = _check_meetings(file.meetings, printed)
    contacts = [c for c in file.contacts(machine) if not file.is_wipe(c)]
    theirs = source() if contacts and (file.own[[c.move for c in contacts]] < 0).any() else None
    forgiven: set[tuple[float, ...]] = set()
    if theirs is not None:
        order = np.arange(len(laying_moves(theirs)))
        other = _file_of(theirs, order, machine, None)
        found = (other.moves[c.move] for c in other.contacts(machine))
        forgiven = {key for move in found for key in _keys(move)}
    lines: list[str] = []
    for c in contacts:
        same = file.own[c.move] < 0 and not forgiven.isdisjoint(_keys(file.moves[c.move]))
        (said if same else lines).append(file.text(c))
    if len(said) > SHOWN:
        said[SHOWN:] = [f"and {len(said) - SHOWN} more like it, as in the source"]
    return faults + listed(FaultKind.HEAD_MATERIAL, lines)


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

    def contacts(self, machine: Machine) -> list[Contact]:
        """Return where the head meets a bead, but for what the source meets too."""
        return find_contacts(
            self.moves, self.beads, machine.heads[0], clearance_mm=machine.clearance_mm,
            tolerance_mm=FILE_TOLERANCE_MM, limit=10 * LIMIT,
            allowed=None if self.meetings is None else self._allowed(self.meetings),
        )  # fmt: skip

    def _allowed(self, meetings: Meetings) -> Allowed:
        left = self._upright(self.before, self.last, 3)
        due = self._upright(self.after, self.next, 0)

        def allowed(move: Ints, bead: Ints, depth: Floats) -> NDArray[np.bool_]:
            met = meetings.allow(self.own[move], self.whose[bead], depth)
            for contour in (left, due):
                met |= meetings.allow(contour[move], self.whose[bead], depth)
            return met

        return allowed

    def _upright(self, contour: Ints, at: Ints, column: int) -> Ints:
        """Return `contour` for moves straight up or down where the move `at` ends or begins."""
        known = np.clip(at, 0, len(self.moves) - 1)
        point = self.moves[known, column : column + 3]
        near = np.abs(self.moves - np.hstack([point, point]))[:, [0, 1, 3, 4]].max(axis=1) < AT_MM
        above = np.minimum(self.moves[:, 2], self.moves[:, 5]) >= point[:, 2] - AT_MM
        return np.where(near & above & (at == known), contour, NOBODY)

    def is_wipe(self, contact: Contact) -> bool:
        """Tell whether a move wipes along the contour printed before it, meeting what that met."""
        c, k = int(self.before[contact.move]), contact.move
        if self.contours is None or self.meetings is None or c < 0 or self.own[k] >= 0:
            return False
        row, bead = np.array([c]), self.whose[[contact.bead]]
        depth = over_tip(self.moves, self.beads, np.array([k]), np.array([contact.bead]))
        if not self.meetings.allow(row, bead, depth)[0]:
            return False
        start, end = self.moves[k, :2], self.moves[k, 3:5]
        path = shapely.linestrings(self.contours.polyline(c)[:, :2])
        steps = start + np.linspace(0.0, 1.0, 9)[:, None] * (end - start)
        return bool((shapely.distance(shapely.points(steps), path) < WIPE_MM).all())

    def text(self, c: Contact) -> str:
        """Return the words for a contact."""
        return (
            f"line {self.line[c.move]}: {c.part} meets the bead of line "
            f"{self.beads.label[c.bead]}, {c.depth_mm:.3f} mm too high, near "
            f"{place_of(self.moves[c.move])}"
        )


def _file_of(motions: Motions, match: Ints, machine: Machine, printed: Printed | None) -> _File:
    rows, laid = moving(motions), laying_moves(motions)
    beads = beads_of(motions, match)
    beads = replace(beads, since=np.searchsorted(rows, beads.since))
    contour = np.full(len(laid), NOBODY) if printed is None else printed.contour
    every = np.full(len(motions.line), NOBODY)
    every[laid] = np.maximum(contour, NOBODY)
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
        None if printed is None else printed.contours,
    )


def _check_meetings(meetings: Meetings, printed: Printed) -> list[Fault]:
    """Check that contours that touch in the source keep their order and run as sliced."""
    n = len(printed.contours)
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


def _keys(move: NDArray[np.float64]) -> list[tuple[float, ...]]:
    """Return what makes two moves the same: both ends, or how low it goes straight up or down."""
    ends = tuple(np.round(move, 3).tolist())
    upright = ends[:2] == ends[3:5]
    return [ends, min(ends[:3], ends[3:])] if upright else [ends]
