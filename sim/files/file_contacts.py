"""Head against material on the moves of a one-head G-code file, start and end code included."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from decmcts.formats.gcode import Motions
from decmcts.print.machine import Machine
from sim.faults import LIMIT, Fault, FaultKind, listed
from sim.files.printed_file import beads_of, laying_moves, moves_array, moving
from sim.replay.material import Beads, Contact, as_material, find_contacts, or_undecided, place_of

FILE_TOLERANCE_MM = 2e-3  # overlap that counts as touching: files have three decimals


def check_file_material(
    motions: Motions,
    match: NDArray[np.int64],
    machine: Machine,
    *,
    source: Callable[[], Motions | None] = lambda: None,
) -> list[Fault]:
    """Move the first head of the machine through the file.

    Parameters
    ----------
    match : (n,) for each laying move the place of its segment in the source
    source
        Returns the source's moves; called only when there are contacts. Those that the
        source makes too are dropped.
    """
    if not (np.asarray(motions.contour) >= 0).any():
        return []
    return or_undecided(lambda: _file_contacts(motions, match, machine, source))


def _file_contacts(
    motions: Motions,
    match: NDArray[np.int64],
    machine: Machine,
    source: Callable[[], Motions | None],
) -> list[Fault]:
    moves, contacts, beads = _contacts_in_file(motions, match, machine)
    theirs = source() if contacts else None
    if theirs is not None:
        order = np.arange(len(laying_moves(theirs)))
        their_moves, known, _ = _contacts_in_file(theirs, order, machine)
        forgiven = {key for c in known for key in _keys(their_moves[c.move])}
        contacts = [c for c in contacts if forgiven.isdisjoint(_keys(moves[c.move]))]
    line = np.asarray(motions.line)[moving(motions)]
    lines = [
        f"line {line[c.move]}: {c.part} meets the bead of line "
        f"{beads.label[c.bead]}, {c.depth_mm:.3f} mm too high, near {place_of(moves[c.move])}"
        for c in contacts
    ]
    return listed(FaultKind.HEAD_MATERIAL, lines)


def _keys(move: NDArray[np.float64]) -> list[tuple[float, ...]]:
    """Return what makes two moves the same: both ends, or how low it goes straight up or down."""
    ends = tuple(np.round(move, 3).tolist())
    upright = ends[:2] == ends[3:5]
    return [ends, min(ends[:3], ends[3:])] if upright else [ends]


def _contacts_in_file(
    motions: Motions, match: NDArray[np.int64], machine: Machine
) -> tuple[NDArray[np.float64], list[Contact], Beads]:
    """Return the moves of a file, those in which the head meets a bead, and the beads."""
    rows = moving(motions)
    beads = beads_of(motions, match)
    beads = replace(beads, since=np.searchsorted(rows, beads.since))
    beads = as_material(beads, machine, FILE_TOLERANCE_MM)
    moves = moves_array(motions)[rows]
    contacts = find_contacts(
        moves,
        beads,
        machine.heads[0],
        clearance_mm=machine.clearance_mm,
        tolerance_mm=FILE_TOLERANCE_MM,
        limit=10 * LIMIT,
    )
    return moves, contacts, beads
