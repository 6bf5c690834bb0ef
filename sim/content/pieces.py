"""Whether the pieces of a cut print part each contour of the source exactly.

A plan says of every point of a piece where on which contour of the source it lies. Nothing of
that is believed: places, filament and feeds are found anew from the source.

**Welds**: how old they are, against what the plan states and its limit. A contour's stretches are
put in a row by where on it they lie. Where one ends and the next begins is a cut; what passes
between the printing of both ends is the weld's age.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import median
from typing import TypeGuard

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.formats.gcode import GcodeDocument
from decmcts.formats.gcode.document import NO_ARC
from decmcts.print.contours import PER_CONTOUR, Contours, Role
from decmcts.print.job import PrintJob
from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from sim.content.arcs import arcs_of_parts
from sim.content.over_walls import crossed_by
from sim.faults import Fault, FaultKind, listed

EXACT = 1e-9  # of places along a contour, of mm and of mm of filament
ROUNDED_MM = 0.5e-3 + 1e-6  # a cut lies on the grid of a file of three decimals
ROUNDED_E_MM = 1.0e-5 + 1e-9  # filament is rounded at both ends of a part of a segment
LEVEL_MM = 1e-6
# What a cut may part. Outside shows; the rest of the roles are never cut. Nor is gap fill: what
# slicers call thin walls is read as that.
INSIDE = (
    Role.PERIMETER, Role.INFILL, Role.SOLID_INFILL, Role.SUPPORT, Role.SUPPORT_INTERFACE,
)  # fmt: skip
INFILL = (Role.INFILL, Role.SOLID_INFILL)
INSIDE_HOP_MM = 5.0  # in infill, across no outer wall: what oozes there does not show
OUTSIDE = (Role.EXTERNAL_PERIMETER, Role.TOP_SOLID_INFILL)
ALIKE = tuple(name for name in PER_CONTOUR if name not in ("closed", "reversible"))


@dataclass(frozen=True, slots=True)
class _Steps:
    """The segments of all pieces: each is a part of a segment of the source, or a hop."""

    point: Ints  # (k,) at its end
    piece: Ints  # (k,)
    of: Ints  # (k,) contour of the source
    begin: Floats  # (k,) place on it
    end: Floats  # (k,)
    row: Ints  # (k,) the source's point at the end of the segment it is a part of
    hop: Flags  # (k,) nothing is printed


def beginnings(pieces: Contours) -> Ints:
    """Return the piece that each contour of the source begins with, or itself, (n_source,)."""
    return np.asarray(np.unique(pieces.sources, return_index=True)[1], np.int64)


def epochs_of_source(pieces: Contours) -> Int32s:
    """Return the epoch of each contour of the source, as its pieces have it."""
    return pieces.epoch[beginnings(pieces)]


@dataclass(frozen=True, slots=True)
class Parted:
    """A source as pieces, made of its own values, or what is wrong with the pieces."""

    job: PrintJob
    faults: tuple[Fault, ...] = ()
    row: Ints | None = None  # (n_points,) the source's point each is of; None: nothing is cut
    whole: Contours | None = None  # the source's contours, where something is cut

    def text(self, document: GcodeDocument) -> GcodeDocument:
        """Return the source's text as pieces have it."""
        pieces = self.job.contours
        if self.row is None or self.whole is None or pieces.of is None or pieces.along is None:
            return document
        begins, first = pieces.offsets[:-1], np.zeros(len(pieces.points), np.bool_)
        first[begins] = True
        arc, owed = document.point_arc[self.row], document.owed[pieces.of]
        arc[first | (pieces.extrusion == 0.0)] = NO_ARC  # no chord ends there
        owed[pieces.along[begins] > 0.0] = 0.0
        part, arcs = arcs_of_parts(pieces.points, np.asarray(arc, np.int64), self.whole, document)
        return replace(
            document, point_state=document.point_state[self.row], owed=owed,
            point_arc=part.astype(np.int32), arcs=arcs,
        )  # fmt: skip


def parted_source(
    pieces: Contours, source: PrintJob, cut: str, *, travel_feed: float | None = None
) -> Parted:
    """Return the source as pieces.

    Parameters
    ----------
    pieces : Contours
        As a plan has them; without `of` the source stays as it is.
    cut : {"none", "inside", "all"}
        What may be cut.
    travel_feed : float | None
        Of travels, mm/s, where the source states none; None: not known.
    """
    if pieces.of is None or pieces.along is None:
        return Parted(source)
    contours, of, along = source.contours, pieces.of.astype(np.int64), pieces.along
    if faults := _named(pieces, of, along, contours):
        return Parted(source, tuple(faults))
    steps = _steps(pieces, of, along, contours)
    faults = [
        *_places(pieces, of, along, contours),
        *_amounts(pieces, contours, steps),
        *_hops(pieces, source, steps, source.settings.travel_feed or travel_feed),
        *_coverage(contours, steps),
        *_allowed(pieces, of, contours, steps, cut),
    ]
    if faults:
        return Parted(source, tuple(faults))
    row = np.zeros(len(pieces.points), np.int64)
    row[steps.point] = steps.row
    ahead = np.concatenate([pieces.offsets[:-1], steps.point[steps.hop]])
    for point in np.sort(ahead)[::-1].tolist():  # a hop leads to what is printed behind it
        row[point] = row[point + 1]
    rates = None if source.acceleration is None else source.acceleration[row]
    return Parted(replace(source, contours=pieces, acceleration=rates), (), row, contours)


def _named(pieces: Contours, of: Ints, along: Floats, contours: Contours) -> list[Fault]:
    """Check that all pieces name contours and places of the source, in its order."""
    n = len(contours)
    if (of < 0).any() or (of >= n).any():
        return [Fault(FaultKind.CONTOUR, f"a piece is of none of the source's {n} contours")]
    wrong = np.flatnonzero(np.diff(of) < 0)
    lines = [f"piece {k + 1} of contour {of[k + 1]} stands behind one of {of[k]}" for k in wrong]
    begin = along[pieces.offsets[:-1]]
    late = np.flatnonzero((np.diff(of) == 0) & (np.diff(begin) <= 0.0)).tolist()
    lines += [f"piece {k + 1} begins before piece {k} on contour {of[k]}" for k in late]
    most = (np.diff(contours.offsets)[of] - 1).repeat(np.diff(pieces.offsets))
    off = np.flatnonzero(~((along >= 0.0) & (along <= most)))
    owner = np.searchsorted(pieces.offsets, off, side="right") - 1
    lines += [f"piece {p} has a point off contour {of[p]}" for p in np.unique(owner).tolist()]
    return listed(FaultKind.CONTOUR, lines)


def _steps(pieces: Contours, of: Ints, along: Floats, contours: Contours) -> _Steps:
    owner = np.repeat(np.arange(len(pieces)), np.diff(pieces.offsets))
    point = np.flatnonzero(owner[1:] == owner[:-1]) + 1
    piece, of = owner[point], of[owner[point]]
    begin, end = along[point - 1], along[point]
    size = np.diff(contours.offsets)[of]
    segment = np.clip(np.floor(begin).astype(np.int64), 0, size - 2)
    row = contours.offsets[of] + segment + 1
    within = (end > begin) & (end <= segment + 1.0)
    hop = ~within | ((pieces.extrusion[point] == 0.0) & (contours.extrusion[row] > 0.0))
    return _Steps(point, piece, of, begin, end, row, hop)


def _places(pieces: Contours, of: Ints, along: Floats, contours: Contours) -> list[Fault]:
    of = of.repeat(np.diff(pieces.offsets))
    first, last = contours.offsets[of], contours.offsets[of + 1] - 1
    vertex = np.minimum(first + np.floor(along).astype(np.int64), last - 1)
    share = (along - (vertex - first))[:, None]
    due = contours.points[vertex] + share * (contours.points[vertex + 1] - contours.points[vertex])
    whole = (share[:, 0] == 0.0) | (share[:, 0] == 1.0)
    off = np.abs(pieces.points - due).max(axis=1)
    bad = np.flatnonzero(off > np.where(whole, EXACT, ROUNDED_MM))
    owner = np.searchsorted(pieces.offsets, bad, side="right") - 1
    rows = np.unique(owner, return_index=True)[1]
    lines = [f"piece {owner[k]} leaves contour {of[bad[k]]} by {off[bad[k]]:.4f} mm" for k in rows]
    return listed(FaultKind.CONTOUR, lines)


def _amounts(pieces: Contours, contours: Contours, steps: _Steps) -> list[Fault]:
    """Check filament and feed of what is printed, part by part and segment by segment."""
    laid = np.flatnonzero(~steps.hop)
    row, point = steps.row[laid], steps.point[laid]
    share = steps.end[laid] - steps.begin[laid]
    given, due = pieces.extrusion[point], share * contours.extrusion[row]
    # what is whole has nothing to be rounded
    wrong = np.abs(given - due) > np.where(share == 1.0, EXACT, ROUNDED_E_MM)
    wrong |= np.abs(pieces.feed[point] - contours.feed[row]) > EXACT
    lines = [
        f"piece {steps.piece[k]} has {pieces.extrusion[steps.point[k]]:.5f} mm of filament at "
        f"{pieces.feed[steps.point[k]]:.3f} mm/s in a part of contour {steps.of[k]}"
        for k in laid[wrong].tolist()
    ]
    total = np.bincount(row, weights=given, minlength=len(contours.points))
    begins = np.zeros(len(contours.points), np.bool_)
    begins[contours.offsets[:-1]] = True
    off = np.flatnonzero((np.abs(total - contours.extrusion) > EXACT) & ~begins)
    owner = np.unique(np.searchsorted(contours.offsets, off, side="right") - 1)
    lines += [f"the pieces of contour {c} have other filament than it" for c in owner.tolist()]
    return listed(FaultKind.EXTRUSION, lines)


def _hops(
    pieces: Contours, source: PrintJob, steps: _Steps, travel_feed: float | None
) -> list[Fault]:
    """Check that nothing is pushed in a hop, and that it is short or does not show.

    The slicer would not retract for it, or it lies in infill, up to `INSIDE_HOP_MM`, and crosses
    no outer wall. A hop is as fast as a travel, where that is known.
    """
    hops = np.flatnonzero(steps.hop)
    a, b = pieces.points[steps.point[hops] - 1], pieces.points[steps.point[hops]]
    length = np.linalg.norm(b - a, axis=1)
    longest = min(each.retract_min_travel_mm for each in source.settings.each())
    wrong = length >= longest
    far = np.flatnonzero(wrong)
    wrong[far] = ~_hidden(source.contours, steps.of[hops[far]], a[far], b[far])
    wrong |= pieces.extrusion[steps.point[hops]] != 0.0
    wrong |= steps.end[hops] <= steps.begin[hops]
    feed = pieces.feed[steps.point[hops]]
    wrong |= False if travel_feed is None else np.abs(feed - travel_feed) > EXACT
    lines = [
        f"piece {steps.piece[k]} hops {d:.3f} mm at {v:.3f} mm/s from {steps.begin[k]:.3f} to "
        f"{steps.end[k]:.3f} along contour {steps.of[k]}"
        for k, d, v in zip(
            hops[wrong].tolist(), length[wrong].tolist(), feed[wrong].tolist(), strict=True
        )
    ]
    return listed(FaultKind.CONTOUR, lines)


def _hidden(contours: Contours, of: Ints, begin: Floats, end: Floats) -> Flags:
    """Tell which hops (k, 3) to (k, 3) lie inside the part, in infill, across no outer wall."""
    length = np.linalg.norm(end - begin, axis=1)
    hidden = np.isin(contours.role[of], INFILL) & (length < INSIDE_HOP_MM)
    rows = np.flatnonzero(hidden)
    height = begin[rows, 2]
    over, _ = crossed_by(contours, begin[rows, :2], end[rows, :2], height, height)
    hidden[rows[over]] = False
    return np.asarray(hidden)


def _coverage(contours: Contours, steps: _Steps) -> list[Fault]:
    """Check that what is printed of each contour is all of it, once."""
    laid = np.flatnonzero(~steps.hop)
    laid = laid[np.lexsort((steps.begin[laid], steps.of[laid]))]
    of, begin, end = steps.of[laid], steps.begin[laid], steps.end[laid]
    first = np.diff(of, prepend=-1) != 0
    due = np.where(first, 0.0, np.concatenate([[0.0], end[:-1]]))
    wrong = set(of[begin != due].tolist())
    last = np.append(first[1:], True) if len(first) else first
    wrong |= set(of[last & (end != np.diff(contours.offsets)[of] - 1)].tolist())
    gone = np.setdiff1d(np.arange(len(contours)), of)
    lines = [f"the pieces of contour {c} are not all of it, once" for c in sorted(wrong)]
    lines += [f"contour {c} has no piece" for c in gone.tolist()]
    return listed(FaultKind.MISSING, lines)


def _allowed(
    pieces: Contours, of: Ints, contours: Contours, steps: _Steps, cut: str
) -> list[Fault]:
    """Check that only what may be cut is, and that pieces are else as their contours are."""
    parted = np.bincount(of, minlength=len(contours)) > 1
    parted[steps.of[steps.hop]] = True
    roles = {"inside": INSIDE, "all": INSIDE + OUTSIDE}.get(cut, ())
    able = np.isin(contours.role, roles) & (contours.top - contours.bottom <= LEVEL_MM)
    lines = [
        f"contour {c} ({Role(int(contours.role[c])).name.lower()}) is cut against cut {cut}"
        for c in np.flatnonzero(parted & ~able).tolist()
    ]
    for name in ALIKE:
        off = np.flatnonzero(getattr(pieces, name) != getattr(contours, name)[of])
        lines += [f"piece {k}: {name} is not that of contour {of[k]}" for k in off.tolist()]
    turned = np.flatnonzero(pieces.reversible & ~contours.reversible[of])
    lines += [f"piece {k} may be reversed, contour {of[k]} may not" for k in turned.tolist()]
    loops = np.flatnonzero(pieces.closed & (~contours.closed[of] | parted[of]))
    lines += [f"piece {k} is no loop" for k in loops.tolist()]
    return listed(FaultKind.CONTOUR, lines)


IN_ONE_GO_S = 1e-3  # between two ends that are one bead again
TOLERANCE_S = 2e-3  # of ages and of what is stated
TimedStretch = tuple[float, float, float, float]  # from and to which place, and when it is at each


def welds_of(document: PlanDocument, all_actions: Sequence[HeadActions]) -> dict[int, list[float]]:
    """Return the age of the weld at each cut of each contour that is cut, s; 0: in one go."""
    stretches: dict[int, list[TimedStretch]] = defaultdict(list)
    contours = document.contours
    if contours.of is None:
        return {}
    for actions in all_actions:
        for action in np.flatnonzero(actions.kind == ActionKind.PRINT).tolist():
            of = int(contours.of[actions.contour[action]])
            stretches[of] += _stretches(contours, actions, action)
    welds = dict[int, list[float]]()
    for of, each in sorted(stretches.items()):
        if len(each) > 1:
            ages = [abs(b[2] - a[3]) for a, b in pairwise(sorted(each))]
            welds[of] = [age if age > IN_ONE_GO_S else 0.0 for age in ages]
    return welds


def _stretches(contours: Contours, actions: HeadActions, action: int) -> Iterator[TimedStretch]:
    piece = int(actions.contour[action])
    first, end = int(contours.offsets[piece]), int(contours.offsets[piece + 1])
    assert contours.along is not None  # as `of`
    along, pushed = contours.along[first:end].tolist(), contours.extrusion[first:end].tolist()
    path = actions.action_path(action)
    if len(path) != len(along):  # a loop entered elsewhere; none that is cut is one
        return
    way = [0.0]
    for a, b in pairwise(path):
        way.append(way[-1] + float(np.linalg.norm(b - a)))
    begin = float(actions.begin_s[action])
    takes = float(actions.end_s[action]) - begin
    when = [begin + takes * passed / (way[-1] or 1.0) for passed in way]
    if actions.reversed[action]:
        when.reverse()
    hops = [0, *(k for k in range(1, len(along)) if pushed[k] == 0.0), len(along)]
    for low, high in pairwise(hops):
        yield along[low], along[high - 1], when[low], when[high - 1]


def check_welds(
    document: PlanDocument, all_actions: Sequence[HeadActions], limit_s: float | None
) -> list[Fault]:
    """Check the ages of welds against a limit, and all that the plan says of its cuts."""
    welds = welds_of(document, all_actions)
    late = [
        f"a weld of contour {of} is {max(ages):.1f} s old, {limit_s:g} s are allowed"
        for of, ages in welds.items()
        if limit_s is not None and max(ages) > limit_s + TOLERANCE_S
    ]
    return listed(FaultKind.WELD, late) + _misstated(document, welds)


def _misstated(document: PlanDocument, welds: dict[int, list[float]]) -> list[Fault]:
    """Return a fault for each figure of the metrics that the plan does not have."""
    stated: object = document.metrics.get("cut")
    if stated is None:
        return []
    contours, ages = document.contours, sorted(a for each in welds.values() for a in each if a)
    of = contours.sources.tolist()
    roles = {c: int(contours.role[bisect_left(of, c)]) for c in welds}
    by_role = Counter[str]()
    for c, each in welds.items():
        by_role[Role(roles[c]).name.lower()] += len(each)
    due: dict[str, float | dict[str, int]] = {
        "contours": len(welds),
        "cuts": sum(map(len, welds.values())),
        "outside": sum(len(each) for c, each in welds.items() if roles[c] in OUTSIDE),
        "roles": dict(by_role),
        "welds": len(ages),
        "weld_median_s": median(ages) if ages else 0.0,
        "weld_most_s": max(ages, default=0.0),
    }
    figures = dict(stated) if isinstance(stated, dict) else {"cut": stated}
    lines = [
        f"cut.{name} is stated as {value}, the plan has {due.get(name, 'no such figure')}"
        for name, value in figures.items()
        if not _alike(value, due.get(name))
    ]
    return listed(FaultKind.WELD, lines)


def _alike(stated: object, due: float | dict[str, int] | None) -> bool:
    if isinstance(due, dict):
        return stated == due
    return due is not None and is_near(stated, due, TOLERANCE_S)


def is_near(stated: object, due: float, within: float) -> bool:
    """Tell whether a plan states a number that is what is due; an int of it may be huge."""
    return is_number(stated) and due - within <= stated <= due + within


def is_number(stated: object) -> TypeGuard[float]:
    """Tell whether what a plan states is a number."""
    return isinstance(stated, int | float) and not isinstance(stated, bool)
