"""Which chords of a contour's traversal are written as one arc.

Planners see chords. Where a traversal runs along all chords of an arc of the source, or along
some from one of its ends or between two vertices, that is an arc again: the same circle,
the other way round if reversed. What a seam's gap leaves of a chord is a straight line.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from decmcts.formats.gcode.document import NO_ARC, GcodeDocument
from decmcts.print.contours import Contours
from decmcts.print.loops_kernels import SLIVER_MM, Rotated


class ArcRun(NamedTuple):
    """Segments first..end - 1 of a traversal, in the order they are printed, that are one arc."""

    end: int
    centre: tuple[float, float]  # mm
    clockwise: bool


def arc_runs(
    document: GcodeDocument, contours: Contours, way: Rotated, *, is_reversed: bool
) -> dict[int, ArcRun]:
    """Return the arcs of a traversal by their first segment.

    `way` runs forwards; with `is_reversed` its segments are counted from its end.
    """
    if not len(document.arcs.centre):
        return {}
    rows = way.rows[1:]
    arc = document.point_arc[rows]
    if not (arc != NO_ARC).any():
        return {}
    whole = (np.abs(way.points[:-1] - contours.points[rows - 1]) < SLIVER_MM).all(axis=1)
    whole &= (np.abs(way.points[1:] - contours.points[rows]) < SLIVER_MM).all(axis=1)
    arc = np.where(whole, arc, NO_ARC)
    parted = (np.diff(arc) != 0) | (np.diff(rows) != 1)
    begins = np.concatenate([[0], np.flatnonzero(parted) + 1])
    ends = np.append(begins[1:], len(rows))
    runs: dict[int, ArcRun] = {}
    for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
        number = int(arc[begin])
        if number == NO_ARC or not _stands_alone(document, number, rows[begin], rows[end - 1]):
            continue
        first, last = (len(rows) - end, len(rows) - begin) if is_reversed else (begin, end)
        x, y = document.arcs.centre[number].tolist()
        runs[first] = ArcRun(last, (x, y), bool(document.arcs.clockwise[number]) != is_reversed)
    return runs


def _stands_alone(document: GcodeDocument, arc: int, first: int, last: int) -> bool:
    """Tell whether an arc from row `first` to row `last` reads back as these chords."""
    inside = document.point_arc[[first - 1, min(last + 1, len(document.point_arc) - 1)]] == arc
    inside[1] &= last + 1 < len(document.point_arc)
    return bool(document.arcs.partible[arc]) or not inside.any()
