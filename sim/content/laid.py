"""Which moves of a file lay down material: beads, vertical beads, and dots pushed on the spot.

Filament that is pushed while the nozzle does not go across the bed may end a retraction. The
judge keeps account of that for each tool: its running sum of filament is at a height once
reached, or below it by what is retracted. Only what goes beyond the height lies somewhere. Where a
bead goes on from the same place it belongs to that bead's begin. Between two beads of
different tools the source's own lines stand, which are compared word by word.
"""

from __future__ import annotations

import numpy as np

from decmcts.arrays import Flags, Floats, Ints

ROUNDING_MM = 1e-3  # of filament
FLOW_MM = 0.2  # a restart may push so much more than was retracted,
LOWERED_MM = 1.0  # or so much where the nozzle then comes straight down to a bead


def lying(extrusion: Floats, tool: Ints) -> Floats:
    """Return what each move pushes beyond all that its tool had pushed before, (m,) mm."""
    beyond = np.zeros(len(extrusion))
    for number in np.unique(tool).tolist():
        rows = np.flatnonzero(tool == number)
        total = np.cumsum(extrusion[rows])
        height = np.maximum.accumulate(np.concatenate([[0.0], total]))[:-1]
        beyond[rows] = total - height
    return beyond


def laying_rows(points: Floats, extrusion: Floats, tool: Ints, known: Flags) -> Ints:
    """Return the moves that lay down material, ascending; linear in their number.

    Parameters
    ----------
    points : (m + 1, 3)
    extrusion : (m,) mm
    tool : (m,) in use
    known : (m,) of a contour, as the file was read: what is pushed there on the spot counts
        whatever comes next
    """
    step = np.diff(points, axis=0)
    across = (step[:, :2] != 0).any(axis=1)
    given = extrusion > 0
    beads = across & given
    beyond = np.where(given & ~across, lying(extrusion, tool), 0.0)
    spots = beyond > ROUNDING_MM
    climbs = spots & (step[:, 2] != 0)
    goes_on = _followed(beads, across | (extrusion < 0), spots)
    at_once = goes_on & _followed(beads, across | (step[:, 2] != 0), spots)
    lowered = goes_on & _followed(beads, across | climbs, spots)
    paid = extrusion - beyond > ROUNDING_MM
    restarts = paid & ((beyond <= FLOW_MM) | (lowered & (beyond <= LOWERED_MM)))
    lies = spots & ~restarts & (climbs | ~at_once) & _amid(beads, tool)
    return np.flatnonzero(beads | lies | (known & given)).astype(np.int64)


def _followed(beads: Flags, stops: Flags, asked: Flags) -> Flags:
    """Tell for which of the `asked` moves the first later one that stops is a bead, (m,)."""
    rows = np.flatnonzero(stops)
    result = np.zeros(len(beads), np.bool_)
    at = np.flatnonzero(asked)
    k = np.searchsorted(rows, at, side="right")
    there = k < len(rows)
    result[at[there]] = beads[rows[k[there]]]
    return result


def _amid(beads: Flags, tool: Ints) -> Flags:
    """Tell which moves lie between two beads of one tool, with no other in use between, (m,)."""
    rows = np.flatnonzero(beads)
    if not len(rows):
        return np.ones(len(beads), np.bool_)
    changes = np.concatenate([[0], np.cumsum(tool[1:] != tool[:-1])])
    at = np.arange(len(beads))
    k = np.searchsorted(rows, at, side="right")
    inside = (k > 0) & (k < len(rows))
    before, behind = rows[np.maximum(k - 1, 0)], rows[np.minimum(k, len(rows) - 1)]
    return np.asarray(inside & (changes[before] == changes[behind]))
