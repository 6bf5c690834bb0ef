"""Closed contours that are entered at another vertex than the slicer's.

Which contours may, how they run then, and what material that can make. The
rule of the seam's gap stands at `decmcts.print.loops_kernels`. Which vertex to
choose is `decmcts.print.seam`'s.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.print.contours import Contours, Role
from decmcts.print.loops_kernels import (
    SLIVER_MM,
    Polylines,
    Rotated,
    entries_allowed,
    exit_points,
    rotate_loop,
    rotate_loops,
)

FLAT_MM = 1e-6
CLIPPED = 0.25  # widths: how far the ends of any loop may be apart
LOOPS = (
    Role.EXTERNAL_PERIMETER,
    Role.PERIMETER,
    Role.OVERHANG_PERIMETER,
    Role.SKIRT_BRIM,
)  # their ends may be a whole width apart: what these roles close is a loop
LEAST_GAP_MM = 0.015  # a shorter one's length and filament are mostly rounding in a file
STAYS = (Role.IRONING, Role.WIPE_TOWER)


def movable(contours: Contours) -> Flags:
    """Tell which contours may be entered at another vertex, (n,).

    Closed ones at one height that the source lets be reversed: not ironing, wipe
    towers, slopes, scarf seams or parts of a verbatim block. A seam's gap is
    none or `LEAST_GAP_MM` long at least.
    """
    gap = np.linalg.norm(contours.end - contours.start, axis=1)
    near = np.where(np.isin(contours.role, LOOPS), 1.0, CLIPPED) * contours.width
    able = contours.closed & contours.reversible & ~np.isin(contours.role, STAYS)
    flat = contours.top - contours.bottom <= FLAT_MM if len(contours) else able
    gap_fits = (gap < SLIVER_MM) | ((gap >= LEAST_GAP_MM) & (gap <= near))
    return np.asarray(able & flat & gap_fits & (np.diff(contours.offsets) >= 4))


def allowed_entries(contours: Contours) -> Flags:
    """Tell for each point whether its contour may be entered there, (n_points,).

    The first point of a contour always may: that is as sliced.
    """
    allowed = np.zeros(len(contours.points), np.bool_)
    entries_allowed(_lines(contours), movable(contours), allowed)
    return allowed


def enter_at(contours: Contours, entry: Int32s) -> Contours:
    """Return the contours as they run when each is entered at its vertex `entry[c]`.

    Numbering and all values of a contour stay; only points and segments change.
    """
    if not entry.any():
        return contours
    return as_run(contours, *rotated(contours, entry))


def as_run(contours: Contours, run: Rotated, offsets: Ints) -> Contours:
    """Return the contours with other points and segments, which lie nowhere along pieces."""
    return replace(
        contours, points=run.points, extrusion=run.extrusion, feed=run.feed, offsets=offsets,
        along=None,
    )  # fmt: skip


def rotated(contours: Contours, entry: Int32s) -> tuple[Rotated, Ints]:
    """Return the arrays of `enter_at` with the source row of each segment, and the offsets."""
    room = len(contours.points) + int((entry > 0).sum())
    out, offsets = _room(room), np.empty(len(contours) + 1, np.int64)
    rotate_loops(_lines(contours), np.ascontiguousarray(entry, np.int32), out, offsets)
    m = int(offsets[-1])
    return Rotated(out.points[:m], out.extrusion[:m], out.feed[:m], out.rows[:m]), offsets


def traversal(contours: Contours, contour: int, entry: int) -> Rotated:
    """Return one contour as it runs when entered at vertex `entry`.

    The `rows` of its segments say whose feed and machine state each one has.
    """
    first, last = int(contours.offsets[contour]), int(contours.offsets[contour + 1]) - 1
    if entry == 0:
        own = slice(first, last + 1)
        rows = np.arange(first, last + 1)
        return Rotated(contours.points[own], contours.extrusion[own], contours.feed[own], rows)
    out = _room(last - first + 2)
    end = rotate_loop(_lines(contours), contour, entry, out, 0)
    return Rotated(out.points[:end], out.extrusion[:end], out.feed[:end], out.rows[:end])


def as_printed(contours: Contours, contour: int, entry: int, *, reverse: bool) -> Rotated:
    """Return one contour the way a head runs it: values of a segment stand at its end there."""
    run = traversal(contours, contour, entry)
    if not reverse:
        return run
    last = np.append(0, np.arange(len(run.rows) - 1, 0, -1))  # a segment ended where it begins now
    return Rotated(run.points[::-1], run.extrusion[last], run.feed[last], run.rows[last])


def exits_of(contours: Contours, contour: Int32s, vertex: Int32s) -> Floats:
    """Return where each of these contours ends if it is entered at that vertex, (k, 3)."""
    out = np.empty((len(contour), 3))
    at = np.ascontiguousarray(vertex, np.int32)
    exit_points(_lines(contours), np.ascontiguousarray(contour, np.int32), at, out)
    return out


def close_gaps(contours: Contours) -> Contours:
    """Return the contours with every movable loop closed.

    That is all the material a loop can have, whatever vertex it is entered at.
    Its filament is not right and must not be used.
    """
    loops = np.flatnonzero(movable(contours) & (contours.start != contours.end).any(axis=1))
    behind = contours.offsets[loops + 1]
    sizes = np.diff(contours.offsets)
    sizes[loops] += 1
    return replace(
        contours,
        points=np.insert(contours.points, behind, contours.start[loops], axis=0),
        extrusion=np.insert(contours.extrusion, behind, 0.0),
        feed=np.insert(contours.feed, behind, contours.feed[behind - 1]),
        offsets=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        along=None,
    )


def _lines(contours: Contours) -> Polylines:
    return Polylines(contours.points, contours.extrusion, contours.feed, contours.offsets)


def _room(rows: int) -> Rotated:
    return Rotated(np.empty((rows, 3)), np.empty(rows), np.empty(rows), np.empty(rows, np.int64))
