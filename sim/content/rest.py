"""Whether what is left of a print that was broken off is a part of it, and of that alone.

Looked at segment by segment, by where they lie: how the rest was found is not asked.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial import cKDTree

from decmcts.print.contours import Contours, joined
from decmcts.print.plan import PlanDocument
from sim.arrays import Flags, Floats, Ints
from sim.content.inventory import (
    E_TOLERANCE_MM,
    FEED_TOLERANCE_MM_S,
    NEAR_MM,
    NO_MATCH,
    Segments,
    contour_segments,
    match_segments,
)
from sim.faults import LIMIT, Fault, FaultKind, listed


def check_rest(
    rest: Contours, printed: Contours | None, whole: PlanDocument, print_with: Mapping[int, int]
) -> list[Fault]:  # fmt: skip
    """Check what is left of a print against the plan that was broken off.

    Each segment of the rest must be one that the plan prints, or, of a bead that was broken off, a
    part of one: with its filament and feed, with its tool or with the one that prints for that
    tool, and printed neither twice nor before. Complexity O(n log n).

    Parameters
    ----------
    rest : Contours
        Of the source that was written of it, whole.
    printed : Contours | None
        What stood on the bed by then.
    print_with : Mapping[int, int]
        Tools of the plan, and the tools that print for them, as a person has allowed.
    """
    due = contour_segments(joined(whole.contours, whole.printed))
    there = joined(rest, printed)
    every = contour_segments(there)
    match, n = match_segments(every, due), int(np.searchsorted(every.place, len(rest)))
    twice = _printed_again(every, due, match, n)
    ours = every.at(np.flatnonzero(every.extrusion[:n] > 0.0))
    match = match[:n][every.extrusion[:n] > 0.0]
    match[_is_other(ours, due, match)] = NO_MATCH
    begun = np.flatnonzero(match == NO_MATCH)
    match[begun] = _parts_of(ours.at(begun), due, np.setdiff1d(np.arange(len(due.ends)), match))
    lines = [
        f"{ours.text(i)} is none of the print" for i in np.flatnonzero(match == NO_MATCH).tolist()
    ]
    faults = listed(FaultKind.EXTRUSION, lines[:LIMIT], total=len(lines))
    found = np.flatnonzero(match != NO_MATCH)
    mine = rest.tool[ours.place[found]].astype(np.int64)
    meant = joined(whole.contours, whole.printed).tool[due.place[match[found]]].astype(np.int64)
    allowed = meant.copy()
    for other, has in print_with.items():
        allowed[meant == other] = has
    off = np.flatnonzero(allowed != mine)
    lines = [
        f"{ours.text(found[k])} is printed with tool {mine[k]}, in the print with tool "
        f"{meant[k]}, which nobody has allowed" for k in off[:LIMIT].tolist()
    ]  # fmt: skip
    faults += listed(FaultKind.INELIGIBLE, lines, total=len(off))
    return [*faults, *twice]


def _is_other(ours: Segments, due: Segments, match: Ints) -> Flags:
    """Tell which segments lie where one of the print does, with other filament or feed, (n,)."""
    at = np.maximum(match, 0)
    if not len(due.ends):
        return np.ones(len(match), np.bool_)
    other = np.abs(ours.extrusion - due.extrusion[at]) > E_TOLERANCE_MM
    return np.asarray(other | (np.abs(ours.feed - due.feed[at]) > FEED_TOLERANCE_MM_S))


def _parts_of(ours: Segments, due: Segments, free: Ints) -> Ints:
    """Return the segment of the print that each of ours is a part of at one end, or NO_MATCH."""
    found = np.full(len(ours.ends), NO_MATCH, np.int64)
    if not len(free) or not len(found):
        return found
    ends = due.ends[free]
    tree = cKDTree(np.concatenate([ends[:, :3], ends[:, 3:]]))
    taken = set[int]()
    for i, (own, filament) in enumerate(zip(ours.ends, ours.extrusion, strict=True)):
        for shared, cut in ((own[3:], own[:3]), (own[:3], own[3:])):
            for near in tree.query_ball_point(shared, NEAR_MM):
                row = int(free[near % len(free)])
                far = due.ends[row, 3:] if near < len(free) else due.ends[row, :3]
                share = _share(shared, cut, far)
                same = abs(share * due.extrusion[row] - filament) <= E_TOLERANCE_MM
                if (
                    row not in taken
                    and same
                    and abs(ours.feed[i] - due.feed[row]) <= (FEED_TOLERANCE_MM_S)
                ):
                    found[i] = row
        if found[i] != NO_MATCH:
            taken.add(int(found[i]))
    return found


def _share(shared: Floats, cut: Floats, far: Floats) -> float:
    """Return which share of a segment lies up to a place on it; NaN where the place is beside."""
    way, part = far - shared, cut - shared
    length = float(np.linalg.norm(way))
    along = float(part @ way) / length if length else 0.0
    beside = float(np.linalg.norm(part - along * way / max(length, 1e-12)))
    return along / length if beside <= NEAR_MM and -NEAR_MM <= along <= length + NEAR_MM else np.nan


def _printed_again(every: Segments, due: Segments, match: Ints, n: int) -> list[Fault]:
    """Return what was printed before, behind row `n`, and is in the rest once more."""
    before = np.flatnonzero(match[n:] == NO_MATCH) + n
    alone = match_segments(every.at(np.arange(n, len(match))), due)[before - n]
    again = before[alone != NO_MATCH]
    lines = [f"{every.text(i)} was printed before" for i in again[:LIMIT].tolist()]
    return listed(FaultKind.DOUBLED, lines, total=len(again))
