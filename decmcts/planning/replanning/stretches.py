"""What is left of the source's contours, in as few stretches as there can be.

A plan may have cut contours. What is left of one is joined again where it follows on, without
the cut: a contour of which nothing is printed is the source's own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from decmcts.formats.gcode.writing.parts import Stretch, contours_of
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.plan import PlanDocument

Able = Callable[[Contours], NDArray[np.bool_]]  # which of some contours a head can print, (n,)


@dataclass(frozen=True, slots=True)
class _PlanSegments:
    """Segments of a plan, by the contour of the source each is of, and along that."""

    of: NDArray[np.int64]  # (k,) contour of the source
    begin: NDArray[np.float64]  # (k,) place on it
    end: NDArray[np.float64]  # (k,)
    row: NDArray[np.int64]  # (k,) point of the source whose segment it is a part of
    point: NDArray[np.int64]  # (k,) point of the plan at its end
    contour: NDArray[np.int64]  # (k,) of the plan


def source_rows(document: PlanDocument, job: PrintJob) -> NDArray[np.int64]:
    """Return the point of the source whose segment each point of the plan is a part of."""
    pieces = document.contours
    if pieces.along is None:
        return np.arange(len(pieces.points))
    of = np.repeat(pieces.sources, np.diff(pieces.offsets))
    return np.asarray(job.contours.offsets[of] + np.ceil(pieces.along).astype(np.int64))


def stretches_left(
    document: PlanDocument, job: PrintJob, rows: NDArray[np.bool_], able: Able
) -> list[Stretch]:
    """Return what these contours of a plan print, as stretches of the source's contours.

    What no one head can print joined stays parted as the plan has it.

    Parameters
    ----------
    job : PrintJob
        The source.
    rows : (n,) contours of the plan
    able : Able
        Tells of contours which a head can print.
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


def _laid(document: PlanDocument, job: PrintJob, rows: NDArray[np.bool_]) -> _PlanSegments:
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
    document: PlanDocument, job: PrintJob, laid: _PlanSegments, new: NDArray[np.bool_]
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
