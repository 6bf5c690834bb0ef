"""Do two files extrude the same? Segment by segment, whatever the order.

What was written is read back by the reader, and not by the judge. Where loops may be entered
anywhere the source's are run first as the result's are (`source_with`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from decmcts.formats.gcode.document import DESCRIBES, GcodeDocument, StateTable
from decmcts.print.job import PrintJob
from sim.content.seams import Moved, job_with

HOT_ENDS = ("temperature hotend",)  # how slots begin that say how hot tools are told to be
XYZ_MM = 1e-3
NEAR_MM = 1.5e-3  # what rounding puts a micrometre apart: ends of an arc that is parted
E_MM = 1.05e-5
FEED_MM_S = 1e-3


def source_with(
    job: PrintJob, document: GcodeDocument, seams: Iterable[Moved]
) -> tuple[PrintJob, GcodeDocument]:
    """Return job and document with loops as they are run."""
    entered, rows = job_with(job, seams)
    return entered, replace(
        document, point_state=document.point_state[rows], point_arc=document.point_arc[rows]
    )


def same_extrusions(
    job_a: PrintJob, doc_a: GcodeDocument, job_b: PrintJob, doc_b: GcodeDocument, *,
    hot_ends: bool = True,
) -> list[str]:  # fmt: skip
    """Return one line per difference between two prints; empty when there is none.

    Compared is the multiset of segments, ends in either order: coordinates to
    0.001 mm, filament to 0.00001 mm, feed, tool, and the machine state in force; without
    `hot_ends` whatever these are told.
    """
    a, b = _segments(job_a), _segments(job_b)
    if len(a) != len(b):
        return [f"{len(a)} segments against {len(b)}"]
    state_a, state_b = _common_states(doc_a, doc_b, () if hot_ends else HOT_ENDS)
    kept_a, kept_b = _kept(job_a, state_a, doc_a), _kept(job_b, state_b, doc_b)
    order_a, order_b = _order(a, kept_a), _order(b, kept_b)
    if not _together(a[order_a], b[order_b]).all():
        order_a, order_b = _paired(a, b, order_a, order_b)
    a, b, kept_a, kept_b = a[order_a], b[order_b], kept_a[order_a], kept_b[order_b]
    faults = []
    for name, wrong in _differing(a, b, kept_a, kept_b):
        if wrong.any():
            k = int(np.flatnonzero(wrong)[0])
            faults.append(
                f"{name} of {int(wrong.sum())} segments differ, first {a[k].round(5).tolist()}"
                f" against {b[k].round(5).tolist()}"
            )
    return faults


def _differing(
    a: NDArray[np.float64], b: NDArray[np.float64], kept_a: NDArray[np.int64],
    kept_b: NDArray[np.int64],
) -> tuple[tuple[str, NDArray[np.bool_]], ...]:  # fmt: skip
    """Return which segments differ from their partners in what, (k,) each."""
    return (
        ("coordinates", ~_together(a, b)),
        ("filament", np.abs(a[:, 6] - b[:, 6]) > E_MM),
        ("feed", np.abs(a[:, 7] - b[:, 7]) > FEED_MM_S),
        ("tool", a[:, 8] != b[:, 8]),
        ("machine state", kept_a != kept_b),
    )


def _rows(job: PrintJob) -> NDArray[np.int64]:
    """Return the points that end a segment."""
    ends = np.ones(len(job.contours.points), np.bool_)
    ends[job.contours.offsets[:-1]] = False
    return np.flatnonzero(ends)


def _segments(job: PrintJob) -> NDArray[np.float64]:
    """Return (k, 9): both ends (the lower first), filament, feed, tool."""
    c, rows = job.contours, _rows(job)
    ends = np.stack([c.points[rows - 1], c.points[rows]], axis=1)
    grid = np.round(ends / XYZ_MM).astype(np.int64)
    swap = np.zeros(len(rows), np.bool_)
    decided = np.zeros(len(rows), np.bool_)
    for axis in range(3):
        swap |= ~decided & (grid[:, 0, axis] > grid[:, 1, axis])
        decided |= grid[:, 0, axis] != grid[:, 1, axis]
    ends[swap] = ends[swap][:, ::-1]
    tool = np.repeat(c.tool, np.diff(c.offsets))[rows]
    rest = np.stack([c.extrusion[rows], c.feed[rows], tool], axis=1)
    return np.concatenate([ends.reshape(-1, 6), rest], axis=1)


def _order(segments: NDArray[np.float64], kept: NDArray[np.int64]) -> NDArray[np.int64]:
    """Sort by place, feed, tool and state, then filament, so that equals meet equals."""
    place = np.round(segments[:, :6] / XYZ_MM).astype(np.int64)
    feed = np.round(segments[:, 7] / FEED_MM_S).astype(np.int64)
    keys = [segments[:, 6], kept, segments[:, 8], feed, *place.T[::-1]]
    return np.lexsort(keys)


def _together(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which segments are as near to their partners as rounding leaves them, (k,)."""
    return np.asarray(np.abs(a[:, :6] - b[:, :6]).max(axis=1, initial=0.0) <= NEAR_MM)


def _paired(
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    order_a: NDArray[np.int64],
    order_b: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return these orders with what is in neighbouring cells of the grid paired at the end."""
    cells = np.round(np.concatenate([a[order_a], b[order_b]])[:, :6] / XYZ_MM).astype(np.int64)
    place = np.unique(cells, axis=0, return_inverse=True)[1].ravel()
    mine, theirs = place[: len(a)], place[len(a) :]
    size = int(place.max()) + 1
    equal = np.bincount(mine, minlength=size) == np.bincount(theirs, minlength=size)
    left_a, left_b = order_a[~equal[mine]], order_b[~equal[theirs]]
    ends = b[left_b, :6]
    tree, free = cKDTree(np.vstack([ends, np.roll(ends, 3, axis=1)])), set(range(len(left_b)))
    partner = []
    for i, near in zip(left_a, tree.query_ball_point(a[left_a, :6], 3 * XYZ_MM), strict=True):
        here = [k % len(ends) for k in near if k % len(ends) in free] or sorted(free)[:1]
        best = min(here, key=lambda k: (abs(b[left_b[k], 6] - a[i, 6]), k))
        free.discard(best)
        partner.append(best)
    return (
        np.concatenate([order_a[equal[mine]], left_a]),
        np.concatenate([order_b[equal[theirs]], left_b[np.array(partner, np.int64)]]),
    )


def _kept(job: PrintJob, state: NDArray[np.int64], doc: GcodeDocument) -> NDArray[np.int64]:
    return np.asarray(state[doc.point_state[_rows(job)]])


def _common_states(
    doc_a: GcodeDocument, doc_b: GcodeDocument, but: tuple[str, ...]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return numbers for the states of both, equal where all commands are, `but` in some slots."""
    seen: dict[frozenset[tuple[str, str]], int] = {}
    return _numbered(doc_a.states, seen, but), _numbered(doc_b.states, seen, but)


def _numbered(
    table: StateTable, seen: dict[frozenset[tuple[str, str]], int], but: tuple[str, ...]
) -> NDArray[np.int64]:
    columns = [k for k, slot in enumerate(table.slots) if _counts(slot, but)]
    kinds, index = np.unique(table.rows[:, columns], axis=0, return_inverse=True)
    names = [table.slots[k] for k in columns]
    numbers = np.array(
        [
            seen.setdefault(
                frozenset((n, table.values[v]) for n, v in zip(names, row, strict=True) if v),
                len(seen),
            )
            for row in kinds.tolist()
        ],
        np.int64,
    )
    return numbers[index.ravel()]


def _counts(slot: str, but: tuple[str, ...]) -> bool:
    return slot not in DESCRIBES and not (but and slot.startswith(but))
