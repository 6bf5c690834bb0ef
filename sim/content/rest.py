"""Whether what is left of a print that was broken off is all of that, once, and that alone.

Looked at segment by segment, by where they lie: how the rest was found is not asked. A plan may
be cut; its rest may have the contours whole, or any parts of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from decmcts.print.contours import Contours, joined
from decmcts.print.plan import PlanDocument
from sim.arrays import Ints
from sim.content.inventory import NO_MATCH, Segments, contour_segments, places_of
from sim.content.spans import Extruded, LiesOn, extruded_by, lies_on, reached_before
from sim.faults import LIMIT, Fault, FaultKind, listed

SUM_MM = 0.01  # of filament of the whole rest, and
SUM_EACH_MM = 1e-6  # for each of its segments: files round


@dataclass(frozen=True, slots=True)
class RestCheck:
    """What is wrong with the rest of a print, and what of the print is nowhere."""

    faults: tuple[Fault, ...]
    missing: str  # in words, what is neither printed nor left; empty: nothing


@dataclass(frozen=True, slots=True)
class _Looked:
    """All that lays filament, and where on the plan that was broken off it lies."""

    ours: Segments  # of the rest, then of what is printed, then of what is left out
    due: Extruded
    spans: LiesOn
    rest: int  # how many are of the rest
    there: int  # how many are of the rest or printed


def check_rest(
    rest: Contours, printed: Contours | None, whole: PlanDocument,
    print_with: Mapping[int, int], left_out: Contours | None = None,
) -> RestCheck:  # fmt: skip
    """Check what is left of a print against the plan that was broken off.

    Each segment of the rest must be one that the plan prints, or a part of one: with its filament
    and feed, the way round that its contour runs where that may not be reversed, with its tool or
    with the one that prints for that tool, and printed neither twice nor before.
    Complexity O(n log n).

    Parameters
    ----------
    rest : Contours
        Of the source that was written of it, whole.
    printed : Contours | None
        What stood on the bed by then.
    print_with : Mapping[int, int]
        Tools of the plan, and the tools that print for them, as a person has allowed.
    left_out : Contours | None
        What is not finished: all else must be in the rest, or printed. None: not known.
    """
    looked = _looked(rest, printed, whole, left_out)
    missing = _missing(looked, len(whole.contours))
    faults = [
        *_foreign(looked), *_twice(looked), *_turned(looked, joined(whole.contours, whole.printed)),
        *_other_tools(looked, rest, joined(whole.contours, whole.printed), print_with),
        *_other_total(looked),
    ]  # fmt: skip
    if left_out is not None and missing:
        faults.append(Fault(FaultKind.MISSING, missing))
    return RestCheck(tuple(faults), missing)


def _looked(
    rest: Contours, printed: Contours | None, whole: PlanDocument, left_out: Contours | None
) -> _Looked:
    """Find where all that is left, printed or left out lies."""
    there = joined(rest, printed)
    ours = contour_segments(joined(there, left_out))
    ours = ours.at(np.flatnonzero(ours.extrusion > 0.0))
    due = extruded_by(whole.contours)
    if whole.printed is not None:
        due = due.followed_by(extruded_by(whole.printed), len(whole.contours))
    counts = np.searchsorted(ours.place, [len(rest), len(there)]).tolist()
    return _Looked(ours, due, lies_on(ours, due), *counts)


def _foreign(looked: _Looked) -> list[Fault]:
    """Return what is in the rest and none of the print, or has other filament or feed there."""
    rows = np.flatnonzero(looked.spans.of[: looked.rest] == NO_MATCH)
    return _each(FaultKind.EXTRUSION, looked.ours, rows, "is none of the print")


def _twice(looked: _Looked) -> list[Fault]:
    """Return what the rest has twice, and what of it was printed before."""
    rows = np.flatnonzero(looked.spans.of[: looked.there] != NO_MATCH)
    of = looked.spans.of[rows]
    order, before = reached_before(of, looked.spans.low[rows], looked.spans.high[rows])
    again = before - looked.spans.low[rows[order]] > looked.due.tolerance[of[order]]
    is_rest = rows[order] < looked.rest
    found = np.flatnonzero(again & (is_rest | np.append(False, is_rest[:-1])))
    ours = rows[order[found]], rows[order[found - 1]]
    mine = np.minimum(*ours)
    is_before = np.maximum(*ours) >= looked.rest
    before_faults = _each(FaultKind.DOUBLED, looked.ours, mine[is_before], "was printed before")
    twice = _each(FaultKind.DOUBLED, looked.ours, mine[~is_before], "is in the rest twice")
    return [*before_faults, *twice]


def _turned(looked: _Looked, whole: Contours) -> list[Fault]:
    """Return what runs against its contour, which may not be reversed."""
    of = looked.spans.of[: looked.rest]
    rows = np.flatnonzero((of != NO_MATCH) & looked.spans.turned[: looked.rest])
    rows = rows[~whole.reversible[looked.due.segments.place[of[rows]]]]
    if len(rows):  # of two that lie in one place, one there and one back, it is not known which
        place = places_of(looked.due.segments)
        rows = rows[np.bincount(place)[place[of[rows]]] == 1]
    words = "runs reversed, but the print forbids that"
    return _each(FaultKind.WRONG_PATH, looked.ours, rows, words)


def _other_tools(
    looked: _Looked, rest: Contours, whole: Contours, print_with: Mapping[int, int]
) -> list[Fault]:
    """Return what is printed with a tool that nobody has allowed."""
    of = looked.spans.of[: looked.rest]
    rows = np.flatnonzero(of != NO_MATCH)
    mine = rest.tool[looked.ours.place[rows]].astype(np.int64)
    meant = whole.tool[looked.due.segments.place[of[rows]]].astype(np.int64)
    allowed = meant.copy()
    for other, has in print_with.items():
        allowed[meant == other] = has
    off = np.flatnonzero(allowed != mine)
    lines = [
        f"{looked.ours.text(rows[k])} is printed with tool {mine[k]}, in the print with tool "
        f"{meant[k]}, which nobody has allowed" for k in off[:LIMIT].tolist()
    ]  # fmt: skip
    return listed(FaultKind.INELIGIBLE, lines, total=len(off))


def _other_total(looked: _Looked) -> list[Fault]:
    """Return a fault where the rest has in all more or less filament than the print has there."""
    rows = np.flatnonzero(looked.spans.of[: looked.rest] != NO_MATCH)
    share = looked.spans.high[rows] - looked.spans.low[rows]
    due = float((share * looked.due.segments.extrusion[looked.spans.of[rows]]).sum())
    found = float(looked.ours.extrusion[rows].sum())
    if abs(found - due) <= SUM_MM + SUM_EACH_MM * len(rows):
        return []
    text = f"{found:.5f} mm of filament are left, the print has {due:.5f} mm there"
    return [Fault(FaultKind.E_TOTAL, text)]


def _missing(looked: _Looked, contours: int) -> str:
    """Return in words what of the plan's own contours is in nothing."""
    spans, due = looked.spans, looked.due
    rows = np.flatnonzero(spans.of != NO_MATCH)
    order, before = reached_before(spans.of[rows], spans.low[rows], spans.high[rows])
    rows = rows[order]
    gap = np.zeros(len(due.segments.ends))
    reach = np.zeros(len(gap))
    np.maximum.at(gap, spans.of[rows], spans.low[rows] - before)
    np.maximum.at(reach, spans.of[rows], spans.high[rows])
    gap = np.maximum(gap, 1.0 - reach)
    gone = np.flatnonzero((gap > due.tolerance) & (due.segments.place < contours))
    if not len(gone):
        return ""
    length = float((gap * due.lengths)[gone].sum())
    return (
        f"{length:.1f} mm of the print are neither printed nor left, among them "
        f"{due.segments.text(int(gone[0]))}"
    )


def _each(kind: FaultKind, segments: Segments, rows: Ints, text: str) -> list[Fault]:
    lines = [f"{segments.text(i)} {text}" for i in rows[:LIMIT].tolist()]
    return listed(kind, lines, total=len(rows))
