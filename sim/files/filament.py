"""Filament between the beads of a file: what is retracted, and what is pushed standing still.

*Owed* is the filament that is retracted at some line and not pushed back yet, mm. The source is
the measure: a bead begins with as much owed as there, no more is pushed at once than the source
ever does, and no more is retracted.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from decmcts.formats.gcode import Motions
from sim.faults import Fault, FaultKind, listed

OWED_MM = 1e-3  # amounts owed that differ by less are equal
SURPLUS_MM = 0.01  # of filament pushed or retracted beyond the source's

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Source = Callable[[], Motions | None]


def check_owed(
    motions: Motions, rows: Ints, place: Ints, laid: tuple[Ints, Ints], source: Source, *,
    expected: bool,
) -> list[Fault]:  # fmt: skip
    """Check that beads begin with as much filament owed as in the source.

    The source's habit is what it usually leaves owed after a retraction. A bead before which
    the source does not retract may have the habit owed too. A bead may have less than the
    habit where nothing was pushed back before it: then nothing had been retracted. Of a segment
    that the source lays twice either amount will do.

    Parameters
    ----------
    rows : (k,) moves of the file that lay known beads
    place : (k,) number of the place each of them lies at
    laid : (m,), (m,) place and contour of every segment of the source
    source
        Returns the source's moves; called only where something is owed, or `expected` to be.
    """
    if motions.owed is None or not len(rows):
        return []
    begins = np.concatenate([[True], np.diff(motions.contour[rows]) != 0])
    rows, place = rows[begins], place[begins]
    owed = motions.owed[rows]
    least, due, habit = np.zeros(len(rows)), np.zeros(len(rows)), 0.0
    theirs = source() if expected or (owed > OWED_MM).any() else None
    if theirs is not None:
        places, contours = laid
        each, habit = _due(theirs, int(contours.max()) + 1)
        low, high = np.full(int(places.max()) + 1, np.inf), np.zeros(int(places.max()) + 1)
        np.minimum.at(low, places, each[contours])
        np.maximum.at(high, places, each[contours])
        least, due = low[place], high[place]
    pushed = _between_beads(motions, motions.extrusion > 0)[rows]
    short = owed > due + OWED_MM
    over = (owed < np.minimum(least, habit) - OWED_MM) & pushed
    line = np.asarray(motions.line)[rows]
    return listed(
        FaultKind.STATE,
        [
            f"line {line[k]} begins a bead with {owed[k]:g} mm retracted"
            + (f", the source with {due[k]:g}" if due[k] > 0.0 else "")
            for k in np.flatnonzero(short | over).tolist()
        ],
    )


def _due(source: Motions, n: int) -> tuple[Floats, float]:
    """Return what the source has owed where each contour begins, (n,) mm, and its habit, mm."""
    due = np.zeros(max(n, int(source.contour.max(initial=-1)) + 1))
    if source.owed is None:
        return due, 0.0
    laying = np.flatnonzero(source.contour >= 0)
    begins = laying[np.concatenate([[True], np.diff(source.contour[laying]) != 0])[: len(laying)]]
    owed = source.owed[begins]
    pulled = _between_beads(source, source.extrusion < 0)[begins] | np.isinf(owed)
    habit = float(np.median(owed[pulled])) if pulled.any() else 0.0
    due[source.contour[begins]] = np.where(pulled, owed, np.maximum(owed, habit))
    return due, habit


def _between_beads(motions: Motions, chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell for each move whether a chosen one lies between it and the bead before it, (m,)."""
    rows = np.arange(len(motions.contour))
    bead = np.asarray(motions.contour) >= 0
    last_bead = np.maximum.accumulate(np.where(bead, rows, -1))
    last_chosen = np.maximum.accumulate(np.where(chosen & ~bead, rows, -1))
    before = np.concatenate([[-1], last_bead[:-1]])
    return np.asarray(last_chosen > before)


def check_pulled(motions: Motions, usual_mm: float, source: Source) -> list[Fault]:
    """Check that between beads no more filament is retracted than the source ever has.

    The source is read only when more than `usual_mm` is.
    """
    owed, line = _owed_between(motions)
    most = usual_mm
    if owed.max(initial=0.0) > most + SURPLUS_MM:
        theirs = source()
        if theirs is not None:
            most = max(most, float(_owed_between(theirs)[0].max(initial=0.0)))
    deep = np.flatnonzero(owed > most + SURPLUS_MM).tolist()
    return listed(
        FaultKind.STATE,
        [
            f"{owed[k]:g} mm are retracted above line {line[k]}, in the source {most:g} at most"
            for k in deep
        ],
    )


def _owed_between(motions: Motions) -> tuple[Floats, Ints]:
    """Return what is retracted by moves between the first bead and the last, and their lines."""
    beads = np.flatnonzero(motions.contour >= 0)
    if motions.owed is None or not len(beads):
        return np.zeros(0), np.zeros(0, np.int64)
    within = slice(int(beads[0]), int(beads[-1]) + 1)
    owed = motions.owed[within]
    return np.where(np.isinf(owed), 0.0, owed), np.asarray(motions.line, np.int64)[within]


def check_surplus(motions: Motions, source: Source) -> list[Fault]:
    """Check that no more filament is pushed on the spot than the source ever does at once.

    The source is read only when something is pushed.
    """
    pushed = _surplus(motions)
    if pushed.max(initial=0.0) <= SURPLUS_MM:
        return []
    theirs = source()
    most = 0.0 if theirs is None else float(_surplus(theirs).max(initial=0.0))
    over = np.flatnonzero(pushed > most + SURPLUS_MM).tolist()
    line = np.asarray(motions.line)
    return listed(
        FaultKind.STATE,
        [f"line {line[k]} pushes {pushed[k]:.3f} mm of filament on the spot" for k in over],
    )


def _surplus(motions: Motions) -> Floats:
    """Return the filament each move pushes standing still, beyond what is retracted, (m,) mm.

    Counted from the first bead to the last; what primes the nozzle before is the source's.
    """
    if motions.owed is None:
        return np.zeros(len(motions.line))
    still = (motions.points[1:] == motions.points[:-1]).all(axis=1)
    beads = np.flatnonzero(motions.contour >= 0)
    rows = np.arange(len(still))
    within = (rows >= beads.min(initial=len(rows))) & (rows <= beads.max(initial=-1))
    return np.where(still & within, motions.extrusion - motions.owed, 0.0)
