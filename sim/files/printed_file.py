"""A one-head G-code file as the judge sees it: moves, and beads that grow with them."""

from __future__ import annotations

import numpy as np

from decmcts.formats.gcode import Motions
from sim.arrays import Floats, Ints
from sim.content.inventory import Segments, move_segments
from sim.content.laid import laying_rows
from sim.replay.shapes import Beads


def laying_moves(motions: Motions) -> Ints:
    """Return the moves that lay down material."""
    n = len(motions.line)
    tool = np.zeros(n, np.int64) if motions.tool is None else np.asarray(motions.tool, np.int64)
    known = np.asarray(motions.contour) >= 0
    return laying_rows(motions.points, np.asarray(motions.extrusion), tool, known)


def segments_of(motions: Motions, laid: Ints) -> Segments:
    """Return the moves that lay down material, `laying_moves`, as the inventory compares them."""
    return move_segments(
        motions.points, motions.extrusion, motions.feed, np.asarray(motions.line, np.int64), laid
    )


def moves_array(motions: Motions) -> Floats:
    """Return every move, (m, 6)."""
    return np.hstack([motions.points[:-1], motions.points[1:]])


def moving(motions: Motions) -> Ints:
    """Return the moves whose path is known: all but homing and G92.

    A move at feed 0 (`F0`) is among them: firmware makes it at the feed before.
    """
    known = np.asarray(motions.feed) > 0
    return np.nonzero(known if motions.placed is None else ~np.asarray(motions.placed))[0]


def beads_of(motions: Motions, laid: Ints, match: Ints) -> Beads:
    """Return the beads of a file with the first move that may meet each.

    Only contours count: a purge line of the start code has no stated size, and the start code
    is not reordered. A contour may slope over itself where it runs as in the source. In another
    traversal each of its segments is material for the next ones.

    Parameters
    ----------
    motions : Motions
    laid : (n,) from `laying_moves`
    match : (n,) for each laying move the place of its segment in the source
    """
    rows = laid
    contour = np.asarray(motions.contour, np.int64)[rows]
    rows, match, contour = (values[contour >= 0] for values in (rows, match, contour))
    if not len(rows):
        raise ValueError("no contour in the file")
    begins = np.concatenate([[True], contour[1:] != contour[:-1]])
    run = np.cumsum(begins) - 1
    last = np.concatenate([np.nonzero(begins)[0][1:] - 1, [len(rows) - 1]])
    forward = np.concatenate([[True], (np.diff(match) == 1) | begins[1:]])
    as_sliced = np.logical_and.reduceat(forward, np.nonzero(begins)[0])[run]
    since = np.where(as_sliced, rows[last[run]], rows) + 1
    return Beads(
        motions.points[rows],
        motions.points[rows + 1],
        np.asarray(motions.width, np.float64)[rows],
        np.asarray(motions.height, np.float64)[rows],
        since,
        np.asarray(motions.line, np.int64)[rows],
    )
