"""Exactly once: the extrusions of a result against those of its source.

Both are multisets of straight segments, each of which may be run either way; a dot, pushed on the
spot, is a segment whose ends are one point. Segments are
matched first by their ends on a grid of a micrometre; equal ones are matched in the order they
come in. What rounding put into neighbouring cells is then matched by distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from decmcts.arrays import Flags, Floats, Ints
from decmcts.print.contours import Contours
from sim.faults import LIMIT, Fault, FaultKind, listed, listed_rows

if TYPE_CHECKING:
    from sim.content.arcs import Turns

GRID_MM = 1e-3
NEAR_MM = 3e-3  # both ends together, rounding to three decimals on both sides
E_TOLERANCE_MM = 1e-4
ROUNDED_E_MM = 2e-5  # files have five decimals
ROUNDED_FEED_MM_S = 1e-3
FEED_TOLERANCE_MM_S = 0.02  # files give whole mm/min
SAME_E_MM = 3e-5  # filament of two segments alike, each rounded to 1e-5 in a file
SAME_FEED_MM_S = 0.01
NO_MATCH = -1


@dataclass(frozen=True, slots=True)
class Segments:
    """Extruding segments, and where each stands."""

    ends: Floats  # (n, 6) start and end
    extrusion: Floats  # (n,) filament mm
    feed: Floats  # (n,) mm/s
    place: Ints  # (n,) line or contour
    word: str  # "line" or "contour"

    @staticmethod
    def joined(parts: Sequence[Segments]) -> Segments:
        """Return all segments of some, in order."""
        ends, extrusion, feed, place = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("ends", "extrusion", "feed", "place")
        )
        return Segments(ends, extrusion, feed, place, parts[0].word)

    def at(self, rows: Ints) -> Segments:
        """Return some of the segments."""
        return Segments(
            self.ends[rows], self.extrusion[rows], self.feed[rows], self.place[rows], self.word
        )

    def text(self, i: int) -> str:
        """Return the words for one segment."""
        x0, y0, z0, x1, y1, z1 = self.ends[i]
        return (
            f"{self.word} {self.place[i]}: ({x0:.3f}, {y0:.3f}, {z0:.3f}) to "
            f"({x1:.3f}, {y1:.3f}, {z1:.3f})"
        )

    def faults(self, kind: FaultKind, rows: Ints, what: str) -> list[Fault]:
        """Return a fault for each of these segments: what is wrong with it."""
        return listed_rows(kind, rows, lambda i: f"{self.text(i)} {what}")


def contour_segments(contours: Contours) -> Segments:
    """Return all segments of all contours that have length or filament."""
    n = len(contours)
    owner = np.repeat(np.arange(n), np.diff(contours.offsets))
    rows = np.nonzero(owner[1:] == owner[:-1])[0] if n else np.empty(0, np.int64)
    ends = np.hstack([contours.points[rows], contours.points[rows + 1]])
    laid = (ends[:, :3] != ends[:, 3:]).any(axis=1) | (contours.extrusion[rows + 1] > 0)
    rows = rows[laid]
    return Segments(
        ends[laid], contours.extrusion[rows + 1], contours.feed[rows + 1], owner[rows], "contour"
    )


def move_segments(
    points: Floats, extrusion: Floats, feed: Floats, line: Ints, rows: Ints
) -> Segments:
    """Return those moves of a file, `rows`, that lay down material (`sim.content.laid`)."""
    ends = np.hstack([points[rows], points[rows + 1]])
    return Segments(ends, extrusion[rows], feed[rows], line[rows].astype(np.int64), "line")


def match_segments(ours: Segments, source: Segments) -> Ints:
    """Return for each of our segments the source's segment it is, or NO_MATCH, (n,).

    No source segment is matched twice. Of segments alike in place, filament and feed
    the first of ours is the source's first, and so on: alike ones of two epochs are
    each matched in its own if the epochs of ours come in the source's order.
    Complexity O(n log n).
    """
    match = np.full(len(ours.ends), NO_MATCH, np.int64)
    mine, theirs = _keys(ours), _keys(source)
    several, due = _match_single(ours, source, mine, theirs, match)
    like, alike = _alike(ours.at(several), source.at(due), mine[several], theirs[due])
    _match_in_turn(match, several, due, like, alike)
    left, free = np.flatnonzero(match == NO_MATCH), _unmatched(source, match)
    if len(left) and len(free):  # same ends, other filament or feed: matched by rank of amount
        left = left[np.lexsort((ours.feed[left], ours.extrusion[left]))]
        free = free[np.lexsort((source.feed[free], source.extrusion[free]))]
        _match_in_turn(match, left, free, mine[left], theirs[free])
    _match_near(ours, source, match)
    return match


def places_of(segments: Segments) -> Ints:
    """Return one number a segment, equal for those between the same two points."""
    return np.unique(_keys(segments), return_inverse=True)[1].astype(np.int64)


def alike_of(segments: Segments) -> Ints:
    """Return one number a segment, equal for those alike in place, feed and filament, (n,)."""
    nothing = np.zeros(0, np.int64)
    keys = _keys(segments)
    return _alike(segments, segments.at(nothing), keys, keys[:0])[0]


def _match_single(
    ours: Segments, source: Segments, mine: NDArray[np.uint64], theirs: NDArray[np.uint64],
    match: Ints,
) -> tuple[Ints, Ints]:  # fmt: skip
    """Match what stands alone at its ends in both, if it is alike, as nearly all is.

    Mutates match. Returns the rows of ours and of the source that may have several partners, or
    none, ascending.
    """
    by_mine, by_theirs = np.argsort(mine), np.argsort(theirs)
    one, other = mine[by_mine], theirs[by_theirs]
    at = np.searchsorted(other, one)
    single = _alone(one)
    single[single] = at[single] < len(other)
    single[single] = (other[at[single]] == one[single]) & _alone(other)[at[single]]
    a, b = by_mine[single], by_theirs[at[single]]
    alike = ~(np.abs(ours.feed[a] - source.feed[b]) > SAME_FEED_MM_S)
    alike &= ~(np.abs(ours.extrusion[a] - source.extrusion[b]) > SAME_E_MM)
    match[a[alike]] = b[alike]
    several, due = np.ones(len(mine), np.bool_), np.ones(len(theirs), np.bool_)
    several[a], due[b] = False, False
    return np.flatnonzero(several), np.flatnonzero(due)


def _alone(ascending: NDArray[np.uint64]) -> Flags:
    """Tell which numbers have no equal beside them, (n,)."""
    new = ascending[1:] != ascending[:-1]
    first, last = np.append(True, new), np.append(new, True)
    return np.asarray(first & last)[: len(ascending)]


def _alike(
    ours: Segments, source: Segments, mine: NDArray[np.uint64], theirs: NDArray[np.uint64]
) -> tuple[Ints, Ints]:
    """Return one number a segment, equal for what is alike in place, feed and filament.

    Amounts may differ by what files round off.
    """
    n = len(mine)
    _, like = np.unique(np.concatenate([mine, theirs]), return_inverse=True)
    like = like.astype(np.int64)
    for amount, step in (
        (np.concatenate([ours.feed, source.feed]), SAME_FEED_MM_S),
        (np.concatenate([ours.extrusion, source.extrusion]), SAME_E_MM),
    ):
        order = np.lexsort((amount, like))
        new = (np.diff(like[order]) != 0) | (np.diff(amount[order]) > step)
        like[order] = np.concatenate([[0], np.cumsum(new)])[: len(order)]
    return like[:n], like[n:]


def _match_in_turn(
    match: Ints, ours: Ints, source: Ints, mine: NDArray[Any], theirs: NDArray[Any]
) -> None:
    """Match rows of ours and of the source with equal numbers, first with first; mutates match."""
    by_mine, by_theirs = (np.argsort(keys, kind="stable") for keys in (mine, theirs))
    mine, theirs = mine[by_mine], theirs[by_theirs]
    rank = np.arange(len(mine)) - np.searchsorted(mine, mine, side="left")
    at = np.searchsorted(theirs, mine, side="left") + rank
    hit = at < np.searchsorted(theirs, mine, side="right")
    match[ours[by_mine[hit]]] = source[by_theirs[at[hit]]]


def _keys(segments: Segments) -> NDArray[np.uint64]:
    """Return one number a segment that is equal for equal ends, whichever comes first."""
    grid = np.rint(segments.ends / GRID_MM).astype(np.int64)
    first, last = _mixed(grid[:, :3]), _mixed(grid[:, 3:])
    low, high = np.minimum(first, last), np.maximum(first, last)
    return low * np.uint64(0x9E3779B97F4A7C15) + high


def _mixed(rows: Ints) -> NDArray[np.uint64]:
    """Hash integer rows (n, 3); the multipliers are large odd constants (splitmix64)."""
    x = np.zeros(len(rows), np.uint64)
    for column in rows.astype(np.uint64).T:
        x = (x ^ column) * np.uint64(0xBF58476D1CE4E5B9)
        x ^= x >> np.uint64(27)
        x *= np.uint64(0x94D049BB133111EB)
        x ^= x >> np.uint64(31)
    return x


def _match_near(ours: Segments, source: Segments, match: Ints) -> None:
    """Match what is left by distance; mutates match."""
    left = np.nonzero(match == NO_MATCH)[0]
    free = _unmatched(source, match)
    if not len(left) or not len(free):
        return
    both = np.vstack([source.ends[free], np.roll(source.ends[free], 3, axis=1)])
    tree = cKDTree(both)
    taken: set[int] = set()
    for i, near in zip(left.tolist(), tree.query_ball_point(ours.ends[left], NEAR_MM), strict=True):
        candidates = [int(free[k % len(free)]) for k in near]
        candidates = [c for c in candidates if c not in taken]
        if candidates:
            due = ours.extrusion[i]
            best = min(candidates, key=lambda c: abs(float(source.extrusion[c] - due)))
            taken.add(best)
            match[i] = best


def _unmatched(source: Segments, match: Ints) -> Ints:
    """Return the source's segments that none of ours is, ascending."""
    free = np.ones(len(source.ends), np.bool_)
    free[match[match != NO_MATCH]] = False
    return np.flatnonzero(free)


def compare(ours: Segments, source: Segments, match: Ints) -> list[Fault]:
    """Return what is missing, doubled, foreign or altered."""
    gone = _unmatched(source, match)
    extra = np.nonzero(match == NO_MATCH)[0]
    known = np.isin(_keys(ours)[extra], _keys(source)) if len(extra) else extra > 0
    doubled, foreign = extra[known], extra[~known]
    faults = [
        *source.faults(FaultKind.MISSING, gone, "is not in the result"),
        *ours.faults(FaultKind.DOUBLED, doubled, "comes more often than in the source"),
        *ours.faults(FaultKind.EXTRUSION, foreign, "is not in the source"),
    ]
    faults += altered(ours, source, match)
    a, b = float(ours.extrusion.sum()), float(source.extrusion.sum())
    if abs(a - b) > 0.01 + 1e-6 * len(source.extrusion):  # each may be rounded in the fifth decimal
        text = f"{a:.5f} mm of filament, the source has {b:.5f} mm"
        faults.append(Fault(FaultKind.E_TOTAL, text))
    return faults


def altered(ours: Segments | Turns, source: Segments | Turns, match: Ints) -> list[Fault]:
    """Return what has other filament or another feed than the source's piece it is."""
    pairs = np.flatnonzero(match != NO_MATCH)
    faults: list[Fault] = []
    for kind, a, b, tolerance, unit in (
        (FaultKind.EXTRUSION, ours.extrusion, source.extrusion, ROUNDED_E_MM, "mm of filament"),
        (FaultKind.FEED, ours.feed, source.feed, ROUNDED_FEED_MM_S, "mm/s"),
    ):
        off = pairs[np.abs(a[pairs] - b[match[pairs]]) > tolerance]
        lines = [
            f"{ours.text(i)} has {a[i]:.5f} {unit}, the source {b[match[i]]:.5f}"
            for i in off[:LIMIT].tolist()
        ]
        faults += listed(kind, lines, total=len(off))
    return faults
