"""Whether what is left of a print that was broken off is all of that, once, and that alone.

Looked at segment by segment, by where they lie: how the rest was found is not asked. A plan may
be cut; its rest may have the contours whole, or any parts of them.

The print itself may be cut. Then parts of one segment that follow on are that segment again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from decmcts.arrays import Flags, Floats, Ints
from decmcts.print.contours import Contours, joined
from decmcts.print.plan import PlanDocument
from sim.content.inventory import (
    E_TOLERANCE_MM,
    FEED_TOLERANCE_MM_S,
    NEAR_MM,
    NO_MATCH,
    Segments,
    contour_segments,
    match_segments,
    places_of,
)
from sim.faults import Fault, FaultKind, listed_rows

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
    there, source = joined(rest, printed), joined(whole.contours, whole.printed)
    ours = contour_segments(joined(there, left_out))
    ours = ours.at(np.flatnonzero(ours.extrusion > 0.0))
    due = extruded_by(whole.contours)
    if whole.printed is not None:
        due = due.followed_by(extruded_by(whole.printed), len(whole.contours))
    counts = np.searchsorted(ours.place, [len(rest), len(there)]).tolist()
    looked = _Looked(ours, due, lies_on(ours, due), *counts)
    missing = _missing(looked, len(whole.contours))
    foreign = np.flatnonzero(looked.spans.of[: looked.rest] == NO_MATCH)
    faults = [
        *ours.faults(FaultKind.EXTRUSION, foreign, "is none of the print"),
        *_twice(looked),
        *_turned(looked, source),
        *_other_tools(looked, rest, source, print_with),
        *_other_total(looked),
    ]
    if left_out is not None and missing:
        faults.append(Fault(FaultKind.MISSING, missing))
    return RestCheck(tuple(faults), missing)


def _twice(looked: _Looked) -> list[Fault]:
    rows = np.flatnonzero(looked.spans.of[: looked.there] != NO_MATCH)
    of = looked.spans.of[rows]
    order, before = reached_before(of, looked.spans.low[rows], looked.spans.high[rows])
    again = before - looked.spans.low[rows[order]] > looked.due.tolerance[of[order]]
    is_rest = rows[order] < looked.rest
    found = np.flatnonzero(again & (is_rest | np.append(False, is_rest[:-1])))
    ours = rows[order[found]], rows[order[found - 1]]
    mine = np.minimum(*ours)
    is_before = np.maximum(*ours) >= looked.rest
    before_faults = looked.ours.faults(FaultKind.DOUBLED, mine[is_before], "was printed before")
    twice = looked.ours.faults(FaultKind.DOUBLED, mine[~is_before], "is in the rest twice")
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
    return looked.ours.faults(FaultKind.WRONG_PATH, rows, words)


def _other_tools(
    looked: _Looked, rest: Contours, whole: Contours, print_with: Mapping[int, int]
) -> list[Fault]:
    of = looked.spans.of[: looked.rest]
    rows = np.flatnonzero(of != NO_MATCH)
    mine = rest.tool[looked.ours.place[rows]].astype(np.int64)
    meant = whole.tool[looked.due.segments.place[of[rows]]].astype(np.int64)
    allowed = meant.copy()
    for other, has in print_with.items():
        allowed[meant == other] = has
    return listed_rows(
        FaultKind.INELIGIBLE, np.flatnonzero(allowed != mine),
        lambda k: f"{looked.ours.text(rows[k])} is printed with tool {mine[k]}, in the print with "
        f"tool {meant[k]}, which nobody has allowed",
    )  # fmt: skip


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


MOST = 0.5  # of a segment, that may be beside or twice where it is hardly longer than rounding
ALIKE_MM_S = 1e-9  # of feeds in one segment


@dataclass(frozen=True, slots=True)
class Extruded:
    """What a print extrudes, segment by segment, as if nothing were cut."""

    segments: Segments  # (n,) with the contour each begins in
    ends: Floats  # (k, 3) where some part of a segment ends
    of: Ints  # (k,) that segment

    @property
    def lengths(self) -> Floats:
        """Return the length of each segment, mm, (n,)."""
        ends = self.segments.ends
        return np.asarray(np.linalg.norm(ends[:, 3:] - ends[:, :3], axis=1))

    @property
    def tolerance(self) -> Floats:
        """Return which share of each segment is rounding, (n,)."""
        return np.minimum(NEAR_MM / np.maximum(self.lengths, NEAR_MM), MOST)

    def followed_by(self, other: Extruded, contours: int) -> Extruded:
        """Return this print with another behind it; this one has so many contours."""
        behind = replace(other.segments, place=other.segments.place + contours)
        ends, of = np.concatenate([self.ends, other.ends]), other.of + len(self.segments.ends)
        segments = Segments.joined([self.segments, behind])
        return Extruded(segments, ends, np.concatenate([self.of, of]))


@dataclass(frozen=True, slots=True)
class LiesOn:
    """Where segments lie on those of a print."""

    of: Ints  # (n,) segment of the print, or NO_MATCH
    low: Floats  # (n,) share of it at which each begins, seen from its start
    high: Floats  # (n,) and ends
    turned: Flags  # (n,) runs against it


def extruded_by(contours: Contours) -> Extruded:
    """Return what a print extrudes."""
    owner = np.repeat(np.arange(len(contours)), np.diff(contours.offsets))
    point = np.flatnonzero((owner[1:] == owner[:-1]) & (contours.extrusion[1:] > 0.0)) + 1
    new = np.ones(len(point), np.bool_)
    if contours.of is not None and contours.along is not None:
        begin, of = contours.along[point - 1], contours.of[owner[point]]
        order = np.lexsort((begin, of))
        point, begin, of = point[order], begin[order], of[order]
        new[1:] = (np.diff(of) != 0) | (np.diff(np.floor(begin)) != 0.0)
        new[1:] |= begin[1:] != contours.along[point[:-1]]
        new[1:] |= np.abs(np.diff(contours.feed[point])) > ALIKE_MM_S
    first = np.flatnonzero(new)
    last = np.append(first[1:], len(new))[: len(first)] - 1
    ends = np.hstack([contours.points[point[first] - 1], contours.points[point[last]]])
    pushed = contours.extrusion[point]
    pushed = np.add.reduceat(pushed, first) if len(first) else pushed
    feed, place = contours.feed[point[first]], owner[point[first]].astype(np.int64)
    part = (np.cumsum(new) - 1).astype(np.int64)
    both = np.concatenate([contours.points[point - 1], contours.points[point]])
    return Extruded(Segments(ends, pushed, feed, place, "contour"), both, np.tile(part, 2))


def lies_on(ours: Segments, due: Extruded) -> LiesOn:
    """Return where segments lie on those of a print: all of one, or a part with its filament."""
    n = len(ours.ends)
    found = LiesOn(np.full(n, NO_MATCH, np.int64), np.zeros(n), np.ones(n), np.zeros(n, np.bool_))
    if not n or not len(due.of):
        return found
    match = match_segments(ours, due.segments)
    whole = np.flatnonzero(match != NO_MATCH)
    whole = whole[_alike(ours.at(whole), due.segments.at(match[whole]), np.ones(len(whole)))]
    found.of[whole] = match[whole]
    start, theirs = ours.ends[whole, :3], due.segments.ends[match[whole]]
    found.turned[whole] = _apart(start, theirs[:, :3]) > _apart(start, theirs[:, 3:])
    _find_parts(ours, due, found)
    return found


def _find_parts(ours: Segments, due: Extruded, found: LiesOn) -> None:
    """Find those that are a part of a segment, or one that another is as well; mutates found."""
    mine, of = _candidates(ours, due, np.flatnonzero(found.of == NO_MATCH))
    a, b = _shares(ours.ends[mine], due.segments.ends[of], due.tolerance[of])
    fits = _alike(ours.at(mine), due.segments.at(of), np.abs(b - a))  # of NaN nothing is
    mine, of, a, b = mine[fits], of[fits], a[fits], b[fits]
    low, high = np.minimum(a, b), np.maximum(a, b)
    chosen = _chosen(mine, of, low, high, due, found)
    rows = mine[chosen]
    found.of[rows], found.low[rows], found.high[rows] = of[chosen], low[chosen], high[chosen]
    found.turned[rows] = b[chosen] < a[chosen]


def _chosen(mine: Ints, of: Ints, low: Floats, high: Floats, due: Extruded, found: LiesOn) -> Ints:
    """Return one candidate of each of ours: one that is free, where several segments lie there."""
    several = np.isin(of, of[np.isin(mine, mine[1:][mine[1:] == mine[:-1]])])
    there: dict[int, list[tuple[float, float]]] = {k: [] for k in of[several].tolist()}
    for k in found.of[np.isin(found.of, list(there))].tolist():
        there[k].append((0.0, 1.0))
    taken, tolerance = dict[int, int](), due.tolerance.tolist()
    for j in range(len(mine)):
        i, k, span = int(mine[j]), int(of[j]), (float(low[j]), float(high[j]))
        end = span[1] - tolerance[k]
        is_free = not any(a < end and span[0] < b - tolerance[k] for a, b in there.get(k, []))
        if is_free and (i not in taken or taken[i] < 0):
            there.get(k, []).append(span)
            taken[i] = j
        elif not is_free:
            taken.setdefault(i, -1 - j)  # unless another is free
    return np.array([j if j >= 0 else -1 - j for j in taken.values()], np.int64)


def _candidates(ours: Segments, due: Extruded, rows: Ints) -> tuple[Ints, Ints]:
    """Return rows of ours, and segments of the print of which a part ends where one of them does.

    Pairs are ascending, each of them once.
    """
    tree = cKDTree(due.ends)
    pairs = []
    for end in (ours.ends[rows, :3], ours.ends[rows, 3:]):
        near = tree.query_ball_point(end, NEAR_MM)
        count = np.array([len(each) for each in near], np.int64)
        every = np.array([k for each in near for k in each], np.int64)
        pairs.append(np.stack([np.repeat(rows, count), due.of[every]], axis=1))
    both = np.unique(np.concatenate(pairs), axis=0)
    return both[:, 0], both[:, 1]


def _shares(ours: Floats, theirs: Floats, tolerance: Floats) -> tuple[Floats, Floats]:
    """Return at which shares of segments others begin and end, (k,); NaN: not on it."""
    way = theirs[:, 3:] - theirs[:, :3]
    square = (way * way).sum(axis=1)
    shares = []
    for point, of_dot in ((ours[:, :3], 0.0), (ours[:, 3:], 1.0)):
        from_start = point - theirs[:, :3]
        share = (from_start * way).sum(axis=1) / np.where(square > 0.0, square, 1.0)
        beside = _apart(from_start, share[:, None] * way)
        on = (beside <= NEAR_MM) & (share >= -tolerance) & (share <= 1.0 + tolerance)
        share = np.where(square > 0.0, np.clip(share, 0.0, 1.0), of_dot)
        shares.append(np.where(on, share, np.nan))
    return shares[0], shares[1]


def _alike(ours: Segments, theirs: Segments, share: Floats) -> Flags:
    """Tell which segments have their share of the filament, and the feed, of others, (n,)."""
    way = theirs.ends[:, 3:] - theirs.ends[:, :3]
    a_mm = theirs.extrusion / np.maximum(np.linalg.norm(way, axis=1), NEAR_MM)
    rounded = np.where(share < 1.0, NEAR_MM * a_mm, 0.0)  # its ends are
    more = np.abs(ours.extrusion - share * theirs.extrusion) - rounded
    slow = np.abs(ours.feed - theirs.feed)
    return np.asarray((more <= E_TOLERANCE_MM) & (slow <= FEED_TOLERANCE_MM_S))


def _apart(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.linalg.norm(a - b, axis=1))


def reached_before(of: Ints, low: Floats, high: Floats) -> tuple[Ints, Floats]:
    """Return spans in order, and up to which share of its segment those before each reach, (n,).

    0 where none is before.
    """
    order = np.lexsort((low, of))
    own = 4.0 * of[order]  # spans of others lie apart
    reach = np.maximum.accumulate(own + high[order])
    before = np.concatenate([[0.0], reach[:-1]])[: len(own)] - own
    return order, np.maximum(before, 0.0)
