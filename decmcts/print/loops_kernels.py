"""Closed contours entered at another vertex: the gap of the old seam moves to the new one.

A loop as sliced may stop a little before its start: slicers clip it, so that the
ends don't pile up. Entered at another vertex it runs on through the old gap and
stops the same length before its new start; the filament that is not laid down
there fills the old gap, so the loop's total stays what it is. Rows are indices
into a print's flat arrays; `first` and `last` are those of a contour's ends.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.compiled import kernel

SLIVER_MM = 2e-3  # shorter pieces are not made: files have three decimals
STEADY = 0.1  # share by which the filament per mm at the two seams may differ


class Polylines(NamedTuple):
    """A print's contours as sliced, see `decmcts.print.contours.Contours`."""

    points: Floats  # (n_points, 3) mm
    extrusion: Floats  # (n_points,) filament mm of the segment ending here
    feed: Floats  # (n_points,) mm/s
    offsets: Ints  # (n + 1,)


class Rotated(NamedTuple):
    """Contours in their chosen traversal, filled from the front."""

    points: Floats  # (m, 3) mm
    extrusion: Floats  # (m,) filament mm of the segment ending here
    feed: Floats  # (m,) mm/s
    rows: Ints  # (m,) source row whose segment this one is, or is part of


@kernel
def distance_of(points: Floats, a: int, b: int) -> float:
    """Return the distance of two rows."""
    x, y = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    z = points[b, 2] - points[a, 2]
    return float(np.sqrt(x * x + y * y + z * z))


@kernel
def gap_of(points: Floats, first: int, last: int) -> float:
    """Return the length of the seam's gap; 0 for one too short to matter."""
    gap = distance_of(points, first, last)
    return gap if gap >= SLIVER_MM else 0.0


@kernel
def clip(
    points: Floats, extrusion: Floats, first: int, at: int, gap: float
) -> tuple[int, float, float]:
    """Take `gap` mm off the end of the way from row `first` to row `at`.

    Returns
    -------
    row : int
        The last segment that is kept, by the row it ends at; `first` if none is.
    share : float
        How much of that segment is taken off, 0 to 1.
    filament : float
        What all that is taken off would have laid down, mm.
    """
    row, left, filament = at, gap, 0.0
    while row > first and left >= SLIVER_MM:
        length = distance_of(points, row - 1, row)
        if length > left + SLIVER_MM:
            return row, left / length, filament + extrusion[row] * left / length
        left -= length
        filament += extrusion[row]
        row -= 1
    return row, 0.0, filament


@kernel
def rotate_loop(lines: Polylines, c: int, entry: int, out: Rotated, at: int) -> int:
    """Write contour c entered at vertex `entry` from row `at` of `out`; return the row behind it.

    Mutates `out`.
    """
    points, extrusion, feed = lines.points, lines.extrusion, lines.feed
    first, last = lines.offsets[c], lines.offsets[c + 1] - 1
    start = first + entry
    for row in range(start, last + 1):
        out.points[at] = points[row]
        out.extrusion[at], out.feed[at], out.rows[at] = extrusion[row], feed[row], row
        at += 1
    if entry == 0:
        return at
    begin = at - (last + 1 - start)
    out.extrusion[begin], out.feed[begin], out.rows[begin] = 0.0, 0.0, start + 1
    gap = gap_of(points, first, last)
    end, share, filament = clip(points, extrusion, first, start, gap)
    closing = at
    if gap > 0.0:
        out.points[at] = points[first]
        out.extrusion[at], out.feed[at], out.rows[at] = filament, feed[last], last
        at += 1
    for row in range(first + 1, end + 1):
        out.points[at] = points[row]
        out.extrusion[at], out.feed[at], out.rows[at] = extrusion[row], feed[row], row
        at += 1
    if share > 0.0:  # what is kept of the last segment, by its length once rounded
        out.points[at - 1] = exit_of(points, end, share)
        kept = distance_of(out.points, at - 2, at - 1) / distance_of(points, end - 1, end)
        out.extrusion[at - 1] *= kept
        out.extrusion[closing] += extrusion[end] * (1.0 - kept - share)
    return at


@kernel
def exit_of(points: Floats, row: int, share: float) -> Floats:
    """Return the point `share` of a segment before its end, to a micrometre as in a file."""
    point = points[row] + share * (points[row - 1] - points[row])
    rounded: Floats = np.floor(point * 1e3 + 0.5) / 1e3
    return rounded


@kernel
def rotate_loops(lines: Polylines, entry: Int32s, out: Rotated, out_offsets: Ints) -> None:
    """Write every contour entered at its vertex `entry[c]`; mutates `out` and `out_offsets`."""
    at = 0
    for c in range(len(entry)):
        out_offsets[c] = at
        at = rotate_loop(lines, c, entry[c], out, at)
    out_offsets[len(entry)] = at


@kernel
def exit_points(lines: Polylines, contour: Int32s, vertex: Int32s, out: Floats) -> None:
    """Write where each contour ends if entered at that vertex; mutates `out` (k, 3)."""
    points, offsets = lines.points, lines.offsets
    for i in range(len(contour)):
        first, last = offsets[contour[i]], offsets[contour[i] + 1] - 1
        if vertex[i] == 0:
            out[i] = points[last]
            continue
        gap = gap_of(points, first, last)
        row, share, _ = clip(points, lines.extrusion, first, first + vertex[i], gap)
        out[i] = exit_of(points, row, share) if share > 0.0 else points[row]


@kernel
def entries_allowed(lines: Polylines, movable: Flags, out: Flags) -> None:
    """Tell for each row whether its contour may be entered there; mutates `out` (n_points,).

    Every contour may be entered as sliced, at its first row. Elsewhere a movable
    one may where the seam really moves (by twice its gap) and where it lays down
    as much filament per mm as at the old seam, which what is saved has to fill.
    """
    points, extrusion, offsets = lines.points, lines.extrusion, lines.offsets
    for c in range(len(movable)):
        first, last = offsets[c], offsets[c + 1] - 1
        out[first] = True
        if not movable[c]:
            continue
        gap = gap_of(points, first, last)
        row, _, due = clip(points, extrusion, first, last, gap)
        way = 0.0
        for at in range(first + 1, last):
            way += distance_of(points, at - 1, at)
            if distance_of(points, at, at + 1) < SLIVER_MM:
                continue  # a first segment of no length is lost when the file is rounded
            if gap == 0.0:
                out[at] = way >= SLIVER_MM
            elif way >= 2.0 * gap and row > first:
                filament = clip(points, extrusion, first, at, gap)[2]
                out[at] = filament > 0.0 and abs(filament - due) <= STEADY * due
