"""What is left of a print: material on the bed, and stretches to print, as few as there can be.

A plan may have cut contours. What is left of one is joined again where it follows on, without
the cut: a contour of which nothing is printed is the source's own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.formats.gcode.writing.parts import Stretch, contours_of
from decmcts.print.contours import Contours, joined, taken
from decmcts.print.cut import LEAST_MM
from decmcts.print.job import PrintJob
from decmcts.print.loops import as_printed, traversal
from decmcts.print.loops_kernels import Rotated
from decmcts.print.plan import PlanDocument
from decmcts.print.print_state import PrintState, length_of, rest_of_line

GRID = 3  # decimals of a file


class LeftBeads(StrEnum):
    """What becomes of a bead that was broken off."""

    FINISH = "finish"  # its rest is printed
    LEAVE = "leave"  # it counts as printed


@dataclass(frozen=True, slots=True)
class Broken:
    """A bead that was broken off."""

    head: str
    contour: int  # of the plan
    missing_mm: float  # at most, of its path
    rest: tuple[Stretch, ...] = ()  # what is printed of it yet; none: it is left


def _parted(one: Stretch, *, hops: bool) -> list[Stretch]:
    """Return what is printed of a stretch that may hop."""
    laid = np.flatnonzero(one.extrusion[1:] == 0.0) + 1 if hops else np.empty(0, np.int64)
    if not len(laid):
        return [one]
    ends, found = [0, *laid.tolist(), len(one.points)], list[Stretch]()
    for a, b in pairwise(ends):
        extrusion, feed = one.extrusion[a:b].copy(), one.feed[a:b].copy()
        extrusion[0] = feed[0] = 0.0
        found.append(
            replace(
                one, points=one.points[a:b], extrusion=extrusion, feed=feed, row=one.row[a:b],
                whole=False,
            )
        )  # fmt: skip
    return [part for part in found if len(part.points) > 1]


def broken_beads(
    document: PlanDocument, job: PrintJob, state: PrintState, left: LeftBeads
) -> list[Broken]:
    """Return the beads that were broken off; those to be finished with what is missing.

    A bead is finished where its head has failed, which says where; how far other heads came
    within a bead no event tells, so theirs are left.
    """
    found = []
    for h, k in state.broken:
        actions, head = document.plan.heads[h], state.heads[h]
        contour, path = int(actions.contour[k]), actions.action_path(k)
        known = head.at if head.is_exact else None
        place = (head.point, 0.0) if known is None else rest_of_line(path, head.point, known)
        missing, rest = _missing(path, *place), list[Stretch]()
        if left is LeftBeads.FINISH and known is not None and missing > LEAST_MM:
            run = traversal(document.contours, contour, int(actions.entry[k]))
            of, rows = int(document.contours.sources[contour]), source_rows(document, job)
            one = _behind(run, place, of, rows[run.rows], reverse=bool(actions.reversed[k]))
            rest = _parted(one, hops=document.contours.of is not None)
        found.append(Broken(head.head, contour, missing, tuple(rest)))
    return found


def _missing(path: Floats, point: int, share: float) -> float:
    """Return the length of a path behind a place on it, mm."""
    if point + 1 >= len(path):
        return 0.0
    return length_of(path[point:]) - share * length_of(path[point : point + 2])


def _behind(
    run: Rotated, place: tuple[int, float], of: int, row: Ints, *, reverse: bool
) -> Stretch:
    """Return what of a bead lies behind a place on it; it runs as its source does."""
    step = -1 if reverse else 1
    (point, share), points = place, run.points[::step]
    at = points[point] + share * (points[point + 1] - points[point])
    points = np.concatenate([[np.round(at, GRID)], points[point + 1 :]])[::step]
    if reverse:
        own = slice(0, len(points))
        extrusion, feed = run.extrusion[own].copy(), run.feed[own].copy()
        extrusion[-1] *= 1.0 - share
    else:
        own = slice(point, len(run.points))
        extrusion, feed = run.extrusion[own].copy(), run.feed[own].copy()
        extrusion[1] *= 1.0 - share
    row = row[own].copy()
    row[0] = row[1]  # so it is none of the contour's begin
    extrusion[0] = feed[0] = 0.0
    return Stretch(of, points, extrusion, feed, row, whole=False)


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Contours of a plan that are not finished, and why."""

    rows: Flags  # (n,) all of them
    apart: Flags  # (n,) those that no living head can print

    def stated(self, contours: Contours) -> str:
        """Return a line on what is missing; empty: nothing is."""
        if not self.rows.any():
            return ""
        layers = contours.layer[self.rows] + 1
        first, last = int(layers.min()), int(layers.max())
        where = f"layer {first}" if first == last else f"layers {first} to {last}"
        count, apart = (len(np.unique(contours.sources[r])) for r in (self.rows, self.apart))
        which = f", and {count - apart} that come after those" if count > apart else ""
        return (
            f"{count} contours are not finished ({where}): "
            f"{apart} that no living head reaches, or has the tool for{which}"
        )


def left_out(document: PlanDocument, rest: Flags, able: Flags) -> LeftOut:
    """Return what of the `rest`, (n,), no living head is `able` to print, (n,).

    With all that must come after it.
    """
    apart = rest & ~able
    rows = apart.copy()
    for a, b in sorted(document.precedence.tolist()):  # they go forward, so `a` is known
        rows[b] |= rows[a] and rest[b]
    return LeftOut(rows, apart)


def printed_contours(
    document: PlanDocument, job: PrintJob, state: PrintState, broken: Sequence[Broken]
) -> Contours | None:
    """Return what stands on the bed, joined; of a bead that is finished but what is printed."""
    done, found = state.done.copy(), document.printed
    for one in broken:
        if one.rest:  # its printed part ends where the rest begins, no higher than that
            done[one.contour] = False
            found = joined(_begun(document, state, one), found)
    if done.any():
        stretches = stretches_left(document, job, done, lambda c: np.ones(len(c), np.bool_))
        found = joined(contours_of(job.contours, stretches), found)
    return found


def _begun(document: PlanDocument, state: PrintState, one: Broken) -> Contours:
    """Return the printed part of a bead that is finished."""
    h, k = next(
        (h, k) for h, k in state.broken if document.plan.heads[h].contour[k] == one.contour
    )  # fmt: skip
    head, actions = state.heads[h], document.plan.heads[h]
    assert head.at is not None  # it is finished, so it is known
    path = actions.action_path(k)
    point, share = rest_of_line(path, head.point, head.at)
    at = path[point] + share * (path[point + 1] - path[point])
    points = np.concatenate([path[: point + 1], [at]])
    run = as_printed(
        document.contours, one.contour, int(actions.entry[k]), reverse=bool(actions.reversed[k])
    )
    own = slice(1, point + 2)
    extrusion, feed = np.append(0.0, run.extrusion[own]), np.append(0.0, run.feed[own])
    extrusion[-1] *= share
    whole = taken(document.contours, np.array([one.contour]))
    return replace(
        whole, points=points, offsets=np.array([0, len(points)]), extrusion=extrusion, feed=feed
    )  # fmt: skip


Able = Callable[[Contours], Flags]  # which of some contours a head can print, (n,)


@dataclass(frozen=True, slots=True)
class _PlanSegments:
    """Segments of a plan, by the contour of the source each is of, and along that."""

    of: Ints  # (k,) contour of the source
    begin: Floats  # (k,) place on it
    end: Floats  # (k,)
    row: Ints  # (k,) point of the source whose segment it is a part of
    point: Ints  # (k,) point of the plan at its end
    contour: Ints  # (k,) of the plan


def source_rows(document: PlanDocument, job: PrintJob) -> Ints:
    """Return the point of the source whose segment each point of the plan is a part of."""
    pieces = document.contours
    if pieces.along is None:
        return np.arange(len(pieces.points))
    of = np.repeat(pieces.sources, np.diff(pieces.offsets))
    return np.asarray(job.contours.offsets[of] + np.ceil(pieces.along).astype(np.int64))


def stretches_left(document: PlanDocument, job: PrintJob, rows: Flags, able: Able) -> list[Stretch]:
    """Return what these contours of a plan print, as stretches of the source's contours.

    What no one head can print joined stays parted as the plan has it.

    `job` is the source, `rows` (n,) are contours of the plan.
    """
    laid = _laid(document, job, rows)
    if not len(laid.of):
        return []
    new = np.ones(len(laid.of), np.bool_)
    new[1:] = (np.diff(laid.of) != 0) | (laid.begin[1:] != laid.end[:-1])
    joined = _joined(document, job, laid, new)
    apart = ~able(contours_of(job.contours, joined))
    if not apart.any():
        return joined
    new[1:] |= apart[np.cumsum(new) - 1][1:] & (np.diff(laid.contour) != 0)
    return _joined(document, job, laid, new)


def _laid(document: PlanDocument, job: PrintJob, rows: Flags) -> _PlanSegments:
    """Return what these contours of a plan print, without hops."""
    plan = document.contours
    sizes, row = np.diff(plan.offsets), source_rows(document, job)
    owner = np.repeat(np.arange(len(plan)), sizes)
    along = plan.along
    if along is None:
        along = (np.arange(len(owner)) - plan.offsets[owner]).astype(np.float64)
    point = np.flatnonzero((owner[1:] == owner[:-1]) & rows[owner[1:]]) + 1
    point = point[(plan.extrusion[point] > 0.0) | (job.contours.extrusion[row[point]] == 0.0)]
    of = plan.sources[owner[point]].astype(np.int64)
    point = point[np.lexsort((along[point - 1], of))]
    of = plan.sources[owner[point]].astype(np.int64)
    return _PlanSegments(of, along[point - 1], along[point], row[point], point, owner[point])


def _joined(
    document: PlanDocument, job: PrintJob, laid: _PlanSegments, new: Flags
) -> list[Stretch]:
    """Return segments as stretches; those that are `new`, (k,), begin one."""
    plan, source = document.contours, job.contours
    own = new.copy()
    own[1:] |= np.diff(laid.row) != 0
    first = np.flatnonzero(own)  # of all parts of one segment of the source that follow on
    last = np.append(first[1:], len(own)) - 1
    row, end, filament = laid.row[first], laid.point[last], plan.extrusion[laid.point]
    is_all = laid.end[last] - laid.begin[first] == 1.0
    pushed = np.where(is_all, source.extrusion[row], np.add.reduceat(filament, first))
    begins = np.append(np.flatnonzero(new[first]), len(first))
    found = []
    for a, b in pairwise(begins.tolist()):
        of, begin = int(laid.of[first[a]]), float(laid.begin[first[a]])
        start = source.offsets[of] + int(np.ceil(begin))
        size = int(source.offsets[of + 1] - source.offsets[of])
        found.append(
            Stretch(
                of,
                plan.points[np.append(laid.point[first[a]] - 1, end[a:b])],
                np.append(0.0, pushed[a:b]),
                np.append(0.0, plan.feed[end[a:b]]),
                np.append(start, row[a:b]),
                whole=begin == 0.0 and float(laid.end[last[b - 1]]) == size - 1,
            )
        )
    return found
