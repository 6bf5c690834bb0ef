"""The text of a source whose contours are cut into pieces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from decmcts.formats.gcode.document import NO_ARC, GcodeDocument
from decmcts.print.contours import Contours


def cut_document(
    document: GcodeDocument, pieces: Contours, row: NDArray[np.int64]
) -> GcodeDocument:
    """Return the document of pieces.

    Parameters
    ----------
    pieces : Contours
        Of a cut print, with `of` and `along`.
    row : (n_points,)
        Point of the source at the end of the segment that each segment is a part of.
    """
    begins = pieces.offsets[:-1]
    hops = pieces.extrusion == 0.0
    arc = document.point_arc[row]
    arc[hops] = NO_ARC  # so is the first point of each piece
    owed = document.owed[pieces.sources]
    if pieces.along is not None:
        owed[pieces.along[begins] > 0.0] = 0.0
    return replace(document, point_state=document.point_state[row], owed=owed, point_arc=arc)


def uncut_segments(document: GcodeDocument) -> NDArray[np.bool_]:
    """Tell which segments may be cut at their ends alone, (n_points,): chords of arcs."""
    return np.asarray(document.point_arc != NO_ARC)


def has_stiff_arc(document: GcodeDocument, contours: Contours) -> NDArray[np.bool_]:
    """Tell which contours have an arc that does not read back as the same chords once cut, (n,)."""
    arcs = document.point_arc
    stiff = arcs != NO_ARC
    stiff[stiff] = ~document.arcs.partible[arcs[stiff]]
    return np.asarray(np.logical_or.reduceat(stiff, contours.offsets[:-1]))
