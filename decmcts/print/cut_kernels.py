"""Where contours are cut, and the stretches between cuts put together to pieces.

A place on a contour is a number *along* it: k + f lies on the segment from vertex k to vertex
k + 1, at the share f of it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.compiled import inlined, kernel
from decmcts.print.loops_kernels import distance_of

SNAP_MM = 0.2  # a cut as near to a vertex goes to the vertex


class Stretches(NamedTuple):
    """What lies between two cuts of one contour, in the order of contours and along them."""

    contour: Int32s  # (k,)
    begin: Floats  # (k,) along the contour
    end: Floats  # (k,)


class CutPoints(NamedTuple):
    """The points of all pieces."""

    points: Floats  # (m, 3) mm
    extrusion: Floats  # (m,) filament mm of the segment ending here; 0 of a hop
    feed: Floats  # (m,) mm/s
    along: Floats  # (m,) place on the source's contour
    row: Ints  # (m,) point of the source at the end of the segment it is a part of


@kernel
def cut_at_lines(
    points: Floats,
    offsets: Ints,
    axis: int,
    lines: Floats,
    line_offsets: Ints,
    whole: Flags,
    least_mm: float,
) -> Stretches:
    """Return the stretches of contours that are cut where they cross lines.

    Parameters
    ----------
    points : (n_points, 3) mm
    offsets : (n + 1,)
    axis : int
        0: lines are places along X, 1: along Y.
    lines : (k,) mm, ascending within each contour's
    line_offsets : (n + 1,) contour c is cut at lines[line_offsets[c]:line_offsets[c + 1]]
    whole : (n_points,) whether the segment ending at a point may be cut at its ends alone
    least_mm : float
        No stretch is shorter.
    """
    n = len(offsets) - 1
    most = n
    for c in range(n):
        for p in range(offsets[c], offsets[c + 1] - 1):
            i, j = _crossed(points, p, axis, lines, line_offsets[c], line_offsets[c + 1])
            most += j - i
    contour, begin, end = np.empty(most, np.int32), np.empty(most), np.empty(most)
    used = 0
    for c in range(n):
        first, last = offsets[c], offsets[c + 1] - 1
        total = 0.0
        for p in range(first, last):
            total += distance_of(points, p, p + 1)
        done, at, begun = 0.0, 0.0, 0.0
        for p in range(first, last):
            step = distance_of(points, p, p + 1)
            a, b = points[p, axis], points[p + 1, axis]
            i, j = _crossed(points, p, axis, lines, line_offsets[c], line_offsets[c + 1])
            for k in range(i, j):
                line = lines[k] if b > a else lines[i + j - 1 - k]
                share = (line - a) / (b - a)
                if whole[p + 1] or share * step < SNAP_MM or (1.0 - share) * step < SNAP_MM:
                    share = 0.0 if share < 0.5 else 1.0
                place = done + share * step
                if place - begun >= least_mm and total - place >= least_mm:
                    contour[used], begin[used], end[used] = c, at, p - first + share
                    at, begun = p - first + share, place
                    used += 1
            done += step
        contour[used], begin[used], end[used] = c, at, last - first
        used += 1
    return Stretches(contour[:used], begin[:used], end[:used])


@inlined
def _crossed(points: Floats, p: int, axis: int, lines: Floats, i: int, j: int) -> tuple[int, int]:
    """Which of the lines i..j - 1 the segment that begins at point p crosses.

    Of a line through a vertex, the segment whose lower end that is.
    """
    a, b = points[p, axis], points[p + 1, axis]
    low, high = min(a, b), max(a, b)
    while i < j and lines[i] < low:
        i += 1
    while i < j and lines[j - 1] >= high:
        j -= 1
    return i, j


@kernel
def points_of(
    points: Floats,
    extrusion: Floats,
    feed: Floats,
    offsets: Ints,
    stretches: Stretches,
    first_of: Flags,
    hop_feed: float,
    xy_scale: float,
    e_scale: float,
) -> CutPoints:
    """Return the points of pieces, which are stretches one after the other.

    Parameters
    ----------
    stretches : Stretches
        In the order of the pieces.
    first_of : (k,) whether a piece begins with this stretch
    hop_feed : float
        mm/s of a hop between two stretches of a piece.
    xy_scale, e_scale : float
        Steps of the file in a mm of way and of filament; cuts lie on these.
    """
    count = 0
    for s in range(len(first_of)):
        count += int(np.ceil(stretches.end[s])) - int(np.floor(stretches.begin[s])) + 1
    out = CutPoints(
        np.empty((count, 3)), np.zeros(count), np.zeros(count), np.empty(count),
        np.empty(count, np.int64),
    )  # fmt: skip
    m = 0
    for s in range(len(first_of)):
        begin, end = stretches.begin[s], stretches.end[s]
        first = offsets[stretches.contour[s]]
        k, last = int(np.floor(begin)), int(np.ceil(end))
        for p in range(k, last + 1):
            place = begin if p == k else min(float(p), end)
            segment = min(int(np.floor(place)), last - 1) if p == k else p - 1
            _place_at(points, first + segment, place - segment, xy_scale, out.points, m)
            out.along[m] = place
            out.row[m] = first + segment + 1
            if p > k:
                before = max(begin, float(p - 1)) - segment
                e, steps = extrusion[first + p], e_scale
                upto = e if place == p else np.floor(e * (place - segment) * steps + 0.5) / steps
                from_ = 0.0 if before == 0.0 else np.floor(e * before * steps + 0.5) / steps
                out.extrusion[m] = upto - from_
                out.feed[m] = feed[first + p]
            elif not first_of[s]:
                out.feed[m] = hop_feed
            m += 1
    return out


@inlined
def _place_at(points: Floats, p: int, share: float, scale: float, out: Floats, m: int) -> None:
    """Write the point at a share of the segment from p to p + 1."""
    for axis in range(3):
        a = points[p, axis]
        if share <= 0.0:
            out[m, axis] = a
        elif share >= 1.0:
            out[m, axis] = points[p + 1, axis]
        else:
            b = points[p + 1, axis]
            out[m, axis] = a if a == b else np.floor((a + share * (b - a)) * scale + 0.5) / scale
