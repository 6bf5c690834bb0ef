"""Moved seams: where a loop may be entered, and what it lays down then.

A loop as sliced stops a gap before its start. Entered at another vertex it must
close that gap, follow the loop's own vertices, and stop as far before its new
start; what is not laid down at the new seam is laid down in the old gap, so that
a loop's filament stays what it was. The path is judged by lengths along the
loop; how the planner makes it is not known here.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from decmcts.arrays import Floats, Ints
from decmcts.formats.gcode import Motions
from decmcts.print.contours import Contours, Role
from decmcts.print.job import PrintJob
from decmcts.print.plan import ActionKind, HeadActions

SAME_MM = 1.1e-3  # points nearer than this are one point: files keep three decimals
CLOSED_MM = 2e-3  # a gap shorter than this is none
LENGTH_MM = 6e-3  # by how much the new gap may be longer or shorter than the old one
FLOW = 0.15  # share by which filament per mm may differ between the two seams
FIXED = (Role.IRONING, Role.WIPE_TOWER)
WALLS = (Role.EXTERNAL_PERIMETER, Role.PERIMETER, Role.OVERHANG_PERIMETER, Role.SKIRT_BRIM)
LOOP_GAP, OTHER_GAP = 1.0, 0.25  # widths between the ends of a wall's loop, and of any other
CLOSING = -1  # row of the segment that closes the old gap


class Moved(NamedTuple):
    """One contour entered at another vertex, as a plan or a file runs it."""

    contour: int
    entry: int
    path: Floats  # (k, 3) from the entry on


@dataclass(frozen=True, slots=True)
class ContourRun:
    """What a loop lays down on its way from another vertex."""

    points: Floats  # (k, 3)
    extrusion: Floats  # (k,) of the segment ending here
    feed: Floats  # (k,)
    rows: Ints  # (k,) point of the source whose segment's state it has


def run_of(contours: Contours, moved: Moved) -> ContourRun | str:
    """Return what a moved contour lays down, or in words why it may not run so."""
    first, last = (int(contours.offsets[moved.contour + k]) - k for k in (0, 1))
    if reason := _forbidden(contours, moved.contour, moved.entry):
        return reason
    rows = _ring(contours, first, last, moved.entry)
    ring = contours.points[np.where(rows == CLOSING, first, rows)]
    path, m = moved.path, len(moved.path)
    if not 2 <= m <= len(ring):
        return f"has {m} points where the loop has {len(ring)}"
    off = float(np.abs(path[:-1] - ring[: m - 1]).max())
    if off > SAME_MM:
        return f"leaves the contour by {off:.3f} mm"
    way = _lengths(ring)
    span = way[m - 1] - way[m - 2]
    end = float(np.linalg.norm(path[-1] - path[-2]))
    share = min(end / span, 1.0) if span > 0.0 else 1.0
    off = float(np.abs(ring[m - 2] + share * (ring[m - 1] - ring[m - 2]) - path[-1]).max())
    if off > SAME_MM or share <= 0.0:
        return f"leaves the loop by {off:.3f} mm at its end"
    gap = float(np.linalg.norm(contours.points[last] - contours.points[first]))
    left = way[-1] - way[m - 2] - share * span
    due, allowed = (gap, LENGTH_MM) if gap >= CLOSED_MM else (0.0, SAME_MM)
    if abs(left - due) > allowed:
        return f"ends {left:.3f} mm before its entry, as sliced {gap:.3f} mm"
    return _filled(contours, moved, rows[:m], path, share)


@dataclass(frozen=True, slots=True)
class Laid:
    """What a print action lays down, segment by segment in its direction."""

    points: Floats  # (k, 3)
    extrusion: Floats  # (k - 1,)
    feed: Floats  # (k - 1,)
    rows: Ints  # (k - 1,) point of the source whose segment's state each has


def laid_by(contours: Contours, actions: HeadActions, action: int) -> Laid | str:
    """Return what a print action lays down, or in words why it may not run so."""
    contour, entry = int(actions.contour[action]), int(actions.entry[action])
    step = -1 if actions.reversed[action] else 1
    if entry:
        run = run_of(contours, Moved(contour, entry, actions.action_path(action)[::step]))
        if isinstance(run, str):
            return run
    else:
        run = _as_sliced(contours, contour)
    return Laid(
        run.points[::step], run.extrusion[1:][::step], run.feed[1:][::step], run.rows[1:][::step]
    )


def _as_sliced(contours: Contours, contour: int) -> ContourRun:
    rows = np.arange(contours.offsets[contour], contours.offsets[contour + 1])
    return ContourRun(contours.points[rows], contours.extrusion[rows], contours.feed[rows], rows)


def _forbidden(contours: Contours, contour: int, entry: int) -> str:
    """Return why a contour may not be entered at this vertex, or nothing."""
    size = int(contours.offsets[contour + 1] - contours.offsets[contour])
    polyline = contours.polyline(contour)
    if not contours.closed[contour] or not 0 < entry < size - 1:
        return f"enters at vertex {entry}, which is no entry of it"
    if not contours.reversible[contour] or contours.role[contour] in FIXED:
        return f"enters at vertex {entry}, but the source forbids moving its seam"
    if np.ptp(polyline[:, 2]) > SAME_MM:
        return f"enters at vertex {entry}, but it is not at one height"
    near = LOOP_GAP if contours.role[contour] in WALLS else OTHER_GAP
    if np.linalg.norm(polyline[0] - polyline[-1]) > near * contours.width[contour]:
        return f"enters at vertex {entry}, but its ends are too far apart for a loop"
    return ""


def _ring(contours: Contours, first: int, last: int, entry: int) -> Ints:
    """Return the rows a loop passes from one vertex round to the same vertex.

    A row stands for the segment that ends there; `CLOSING` for the one over the old gap.
    """
    gap = np.linalg.norm(contours.points[last] - contours.points[first])
    over = [CLOSING] if gap >= CLOSED_MM else []
    start = first + entry
    return np.concatenate(
        [np.arange(start, last + 1), over, np.arange(first + 1, start + 1)]
    ).astype(np.int64)


def _lengths(points: Floats) -> Floats:
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _filled(
    contours: Contours, moved: Moved, rows: Ints, path: Floats, share: float
) -> ContourRun | str:
    """Return the run with its filament: the old gap gets what the new one leaves out."""
    first, last = (int(contours.offsets[moved.contour + k]) - k for k in (0, 1))
    closing = rows == CLOSING
    source = np.where(closing, last, rows)
    extrusion = np.where(closing, 0.0, contours.extrusion[source])
    extrusion[0] = 0.0
    extrusion[-1] *= share
    total = float(contours.extrusion[first + 1 : last + 1].sum())
    rest = total - float(extrusion.sum())
    if closing.any():
        gap = float(np.linalg.norm(contours.points[last] - contours.points[first]))
        way = _lengths(contours.points[first : last + 1])
        laid = np.concatenate([[0.0], np.cumsum(contours.extrusion[first + 1 : last + 1])])
        due = float(laid[-1] - np.interp(way[-1] - gap, way, laid))  # what its last mm lay down
        if abs(rest - due) > FLOW * due:
            return f"would fill its old seam with {rest:.5f} mm of filament instead of {due:.5f}"
        extrusion[closing] = rest
    source[0] = source[1]
    return ContourRun(path, extrusion, contours.feed[source], source)


def seams_of_plan(actions: HeadActions) -> Iterator[Moved]:
    """Yield the contours a plan enters at another vertex, each run forwards."""
    moved = (actions.kind == ActionKind.PRINT) & (actions.entry > 0)
    for a in np.flatnonzero(moved).tolist():
        path = actions.action_path(a)
        yield Moved(
            int(actions.contour[a]),
            int(actions.entry[a]),
            path[::-1] if actions.reversed[a] else path,
        )


def seams_of_file(ours: Contours, source: Contours) -> Iterator[Moved]:
    """Yield the contours of a file that run a loop of the source from another vertex.

    A contour that starts and ends where one of the source does is as sliced.
    """
    return seams_of_paths([ours.polyline(c) for c in range(len(ours))], source)


def seams_of_paths(paths: Sequence[Floats], source: Contours) -> Iterator[Moved]:
    """Yield the paths, each (k, 3), that run a loop of the source from another vertex.

    Each path is one loop, and no loop is run twice: one that runs back on itself fits either
    way round, and of two that coincide each path fits both.
    """
    if not paths or not len(source):
        return
    ends = np.hstack([source.start, source.end])
    given = cKDTree(np.vstack([ends, np.roll(ends, 3, axis=1)]))
    ours = np.array([np.concatenate([path[0], path[-1]]) for path in paths])
    away, _ = given.query(ours, distance_upper_bound=3 * SAME_MM)
    vertices = cKDTree(source.points)
    taken = set[int]()
    for c in np.flatnonzero(~np.isfinite(away)).tolist():
        fitting = (
            moved
            for path in (paths[c], paths[c][::-1])
            for moved in _entered(source, vertices, path)
            if moved.contour not in taken
        )
        if (moved := next(fitting, None)) is not None:
            taken.add(moved.contour)
            yield moved


def _entered(source: Contours, vertices: cKDTree, path: Floats) -> Iterator[Moved]:
    """Yield which loops of the source a path may run, and from where."""
    for row in sorted(vertices.query_ball_point(path[0], 2 * SAME_MM)):
        contour = int(np.searchsorted(source.offsets, row, side="right")) - 1
        moved = Moved(contour, int(row - source.offsets[contour]), path)
        if isinstance(run_of(source, moved), ContourRun):
            yield moved


def job_with(job: PrintJob, seams: Iterable[Moved]) -> tuple[PrintJob, Ints]:
    """Return the job with loops as they are run, and whose machine state each point has.

    Those that may not run so stay as sliced, and will be missed.
    """
    contours = job.contours
    runs = {moved.contour: run_of(contours, moved) for moved in seams}
    if not runs:
        return job, np.arange(len(contours.points), dtype=np.int64)
    pieces = []
    for c in range(len(contours)):
        run = runs.get(c)
        pieces.append(run if isinstance(run, ContourRun) else _as_sliced(contours, c))
    entered = replace(
        contours,
        points=np.concatenate([run.points for run in pieces]),
        extrusion=np.concatenate([run.extrusion for run in pieces]),
        feed=np.concatenate([run.feed for run in pieces]),
        offsets=np.cumsum([0, *(len(run.points) for run in pieces)]).astype(np.int64),
    )
    return replace(job, contours=entered), np.concatenate([run.rows for run in pieces])


def motions_with(source: Motions, contours: Contours, seams: Iterable[Moved]) -> Motions:
    """Return the moves of a source with loops as they are run; `contours` are its own.

    A bare move leads to each such loop and from it to where the source's ended.
    """
    by_contour = np.argsort(source.contour, kind="stable")
    begin = np.searchsorted(np.asarray(source.contour)[by_contour], np.arange(len(contours) + 1))
    take, swaps, at, size = [], [], 0, 0
    for moved in sorted(seams, key=lambda moved: moved.contour):
        run, c = run_of(contours, moved), moved.contour
        moves = by_contour[begin[c] : begin[c + 1]]  # bare ones may lie in between
        if not isinstance(run, ContourRun) or len(moves) != np.diff(contours.offsets)[c] - 1:
            continue
        a, end = int(moves[0]), int(moves[-1]) + 1
        block = [np.arange(at, a), [a], moves[run.rows[1:] - contours.offsets[c] - 1], [end - 1]]
        swaps.append((size + a - at, run, source.points[end]))
        take += block
        size += sum(map(len, block))
        at = end
    if not swaps:
        return source
    rows = np.concatenate([*take, np.arange(at, len(source.extrusion))]).astype(np.int64)
    return _swapped(source, rows, swaps)


def _swapped(source: Motions, rows: Ints, swaps: list[tuple[int, ContourRun, Floats]]) -> Motions:
    """Return these moves of a source; from each place on runs with a bare move around them."""
    ends, extrusion = source.points[rows + 1], np.asarray(source.extrusion)[rows]
    contour = np.asarray(source.contour)[rows]
    for place, run, behind in swaps:
        inner = slice(place + 1, place + len(run.points))
        ends[place], ends[inner], ends[inner.stop] = run.points[0], run.points[1:], behind
        extrusion[inner] = run.extrusion[1:]
        extrusion[[place, inner.stop]], contour[[place, inner.stop]] = 0.0, -1
    placed = None if source.placed is None else source.placed[rows]
    tool = None if source.tool is None else source.tool[rows]
    return Motions(
        np.concatenate([source.points[:1], ends]), extrusion, np.asarray(source.feed)[rows],
        np.asarray(source.line)[rows], contour, np.asarray(source.width)[rows],
        np.asarray(source.height)[rows], placed=placed, tool=tool,
    )  # fmt: skip
