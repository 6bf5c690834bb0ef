"""Do two files extrude the same? Segment by segment, whatever the order.

Used by tests and by anyone who wants to see for himself that a reordered file
prints the same beads under the same machine state.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from decmcts.formats.gcode.document import DESCRIBES, GcodeDocument, StateTable
from decmcts.formats.gcode.reading.reader import Ending
from decmcts.print.job import PrintJob

HOT_ENDS = ("temperature hotend",)  # how slots begin that say how hot tools are told to be
XYZ_MM = 1e-3
NEAR_MM = 1.5e-3  # what rounding puts a micrometre apart: ends of an arc that is parted
E_MM = 1.05e-5
FEED_MM_S = 1e-3
OVER_MM = 1.0  # above the print the head may stand when its end G-code begins


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
    if _same_at_once(a, b, kept_a, kept_b):
        return []
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


def _same_at_once(
    a: NDArray[np.float64], b: NDArray[np.float64], kept_a: NDArray[np.int64],
    kept_b: NDArray[np.int64],
) -> bool:  # fmt: skip
    """Tell whether all is the same, without sorting by more than one number a segment.

    Where it is not, whoever asks has to sort it out; equals are paired as `_order` pairs them.
    """
    number_a, number_b = _numbers(a), _numbers(b)
    order_a, order_b = _by_number(number_a, a, kept_a), _by_number(number_b, b, kept_b)
    if (number_a[order_a] != number_b[order_b]).any():
        return False
    pairs = (a[order_a], b[order_b], kept_a[order_a], kept_b[order_b])
    return not any(wrong.any() for _, wrong in _differing(*pairs))


def _numbers(segments: NDArray[np.float64]) -> NDArray[np.uint64]:
    """Return a number for each place on the grid, (k,); hardly ever one for two places."""
    number = np.zeros(len(segments), np.uint64)
    for column in segments[:, :6].T:
        cell = np.round(column / XYZ_MM).astype(np.int64).astype(np.uint64)
        number = (number ^ cell) * np.uint64(0x9E3779B97F4A7C15)
        number ^= number >> np.uint64(29)
    return number


def _by_number(
    number: NDArray[np.uint64], segments: NDArray[np.float64], kept: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Sort by number; those with equal numbers as `_order` does."""
    order = np.argsort(number)
    equal = number[order[1:]] == number[order[:-1]]
    several = np.flatnonzero(np.append(equal, False) | np.append(False, equal))
    rows = order[several]
    rows = rows[_order(segments[rows], kept[rows])]
    order[several] = rows[np.argsort(number[rows], kind="stable")]
    return order


def ending_faults(document: GcodeDocument, ending: Ending, *, hot_ends: bool = True) -> list[str]:
    """Return how a file made from `document` reaches its end G-code otherwise than the source.

    End G-code relies on where the head is, what is retracted, and what is set; without `hot_ends`
    these may be told anything.
    """
    cursor, table, end = ending.cursor, ending.states, document.end
    faults = _place(ending, end.position)
    if abs(cursor.owed - end.owed) > XYZ_MM or cursor.firmware_retracted != end.firmware_retracted:
        faults.append(f"{cursor.owed:.3f} mm are retracted, in the source {end.owed:.3f}")
    if cursor.relative_e != end.relative_e or cursor.tool != end.tool:
        faults.append("the mode of E or the tool is another")
    if not end.relative_e and abs(cursor.e - end.e) > XYZ_MM:
        faults.append(f"E stands at {cursor.e:.5f}, in the source at {end.e:.5f}")
    but = () if hot_ends else HOT_ENDS
    ours, theirs = _commands(table, cursor.state, but), _commands(document.states, end.state, but)
    faults += [f"in force is '{a}'" for _, a in sorted(ours - theirs)]
    faults += [f"not in force is '{a}'" for _, a in sorted(theirs - ours)]
    return [f"before the end G-code {fault}" for fault in faults]


def _place(ending: Ending, place: tuple[float, float, float]) -> list[str]:
    """Return what is wrong with where the head is when it should be at, or above, `place`.

    On the print it may only stand where it has just laid the last bead.
    """
    at = ending.cursor.position
    if max(abs(a - b) for a, b in zip(at[:2], place[:2], strict=True)) > 2 * XYZ_MM:
        return [f"the head is at {at}, in the source at {place}"]
    just_laid = max(abs(a - b) for a, b in zip(at, ending.laid, strict=True)) <= 2 * XYZ_MM
    if just_laid and abs(at[2] - place[2]) <= 2 * XYZ_MM:
        return []
    if at[2] <= ending.top + XYZ_MM:
        return [f"the head comes down on the print at {at}, {ending.top:g} mm high"]
    highest = max(ending.top, place[2]) + OVER_MM
    return [f"the head is at {at}, above {highest:g} mm"] if at[2] > highest else []


def _commands(table: StateTable, state: int, but: tuple[str, ...]) -> set[tuple[str, str]]:
    """Return slot and text of all that commands something in a state, `but` some slots."""
    pairs = zip(table.slots, table.rows[state].tolist(), strict=True)
    return {(slot, table.values[v]) for slot, v in pairs if v and _counts(slot, but)}


def _counts(slot: str, but: tuple[str, ...]) -> bool:
    return slot not in DESCRIBES and not (but and slot.startswith(but))


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
