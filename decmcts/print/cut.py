"""Contours cut into pieces, so that several heads can share what one contour covers.

A *piece* is one or more stretches of one contour, in the contour's own order, with hops so
short that the slicer would not retract. In infill hops may be longer, up to `INSIDE_HOP_MM`, if
they stay inside the part: what oozes there does not show, and filament that is pulled back and
pushed for every line of infill is ground. Cura's combing, OrcaSlicer's `reduce_infill_retraction`
and PrusaSlicer's `only_retract_when_crossing_perimeters` do the same. To all planners a piece is
a contour. Where contours are cut is decided in `decmcts.team.cutting`.

A *weld* is where two stretches of one contour meet that were not printed in one go. Its age is
the time from when the first of its two ends is printed until the other is, by the plan's times.
Within an action the nozzle is taken to move evenly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.print.contours import PER_CONTOUR, Contours, Role
from decmcts.print.cut_kernels import Stretches, cut_at_lines, points_of
from decmcts.print.job import PrintJob
from decmcts.print.metrics import CutMetrics
from decmcts.print.plan import ActionKind, HeadActions, JointPlan
from decmcts.print.walls import bare_pairs
from decmcts.print.walls_kernels import Walls

INSIDE_HOP_MM = 5.0  # longest hop in infill
ASIDE_MM = 0.01  # a hop beside this one, either side, must stay inside too: ends are rounded
INFILL = (Role.INFILL, Role.SOLID_INFILL)  # that is inside the part
LEAST_MM = 0.4  # no stretch is shorter
OUTSIDE = (Role.EXTERNAL_PERIMETER, Role.TOP_SOLID_INFILL)  # what shows
AT_ONCE_S = 1e-3  # stretches printed so soon one after the other are one bead again


@dataclass(frozen=True, slots=True)
class CutLines:
    """Where contours are to be cut."""

    axis: int  # 0: at places along X, 1: along Y
    at: Floats  # (k,) mm, ascending within each contour's
    offsets: Ints  # (n + 1,) contour c is cut at at[offsets[c]:offsets[c + 1]]


@dataclass(frozen=True, slots=True)
class Grid:
    """The steps of a file: cuts lie on them, so that nothing is rounded twice."""

    xy: float = 1e3  # steps a mm
    e: float = 1e5  # steps a mm of filament


def cut_metrics(pieces: Contours) -> CutMetrics:
    """Return how many contours are cut, at how many places, in what, and how many outside."""
    of, hop = pieces.sources, pieces.extrusion == 0.0
    hop[pieces.offsets[:-1]] = False
    stretches = np.add.reduceat(hop.astype(np.int64), pieces.offsets[:-1]) + 1
    first = np.unique(of, return_index=True)[1]
    of_source = np.bincount(of, weights=stretches, minlength=int(of.max(initial=-1)) + 1)
    cuts = of_source[of[first]].astype(np.int64) - 1
    role = pieces.role[first].astype(np.int64)
    of_role = np.bincount(role, weights=cuts, minlength=len(Role)).astype(np.int64)
    most_first = np.argsort(-of_role, kind="stable").tolist()
    return {
        "contours": int((cuts > 0).sum()),
        "cuts": int(cuts.sum()),
        "outside": int(cuts[np.isin(role, OUTSIDE)].sum()),
        "roles": {Role(r).name.lower(): int(of_role[r]) for r in most_first if of_role[r]},
    }


def cut_job(
    job: PrintJob, lines: CutLines, *, walls: Walls, hop_mm: float, hop_feed: float,
    whole: Flags, grid: Grid,
) -> tuple[PrintJob, Ints]:  # fmt: skip
    """Return the job with its contours cut at lines.

    Parameters
    ----------
    walls : Walls
        The outer walls of the job.
    hop_mm : float
        Stretches of one strip whose ends are no farther apart become one piece; those of infill
        also where they are no farther apart than `INSIDE_HOP_MM` inside the part.
    hop_feed : float
        mm/s of these hops.
    whole : (n_points,) whether the segment ending at a point may be cut at its ends alone

    Returns
    -------
    tuple[PrintJob, Ints]
        Also the point of the source at the end of the segment that each segment is a part of,
        (n_points,).
    """
    c = job.contours
    parts = cut_at_lines(c.points, c.offsets, lines.axis, lines.at, lines.offsets, whole, LEAST_MM)
    parts, first = _grouped(c, parts, lines, walls, hop_mm)
    made = points_of(
        c.points, c.extrusion, c.feed, c.offsets, parts, first, hop_feed, grid.xy, grid.e
    )
    sizes = np.ceil(parts.end).astype(np.int64) - np.floor(parts.begin).astype(np.int64) + 1
    begins = np.flatnonzero(first)
    offsets = np.concatenate([[0], np.cumsum(np.add.reduceat(sizes, begins))]).astype(np.int64)
    of = parts.contour[begins]
    count = np.bincount(of, minlength=len(c))
    uncut = (count[of] == 1) & (np.diff(offsets) == np.diff(c.offsets)[of])
    values = {name: getattr(c, name)[of] for name in PER_CONTOUR}
    contours = Contours(
        points=made.points, offsets=offsets, extrusion=made.extrusion, feed=made.feed,
        of=of, along=made.along, **{**values, "closed": c.closed[of] & uncut},
    )  # fmt: skip
    rate = None if job.acceleration is None else job.acceleration[made.row]
    return replace(job, contours=contours, acceleration=rate), made.row


def _grouped(
    c: Contours, parts: Stretches, lines: CutLines, walls: Walls, hop_mm: float
) -> tuple[Stretches, Flags]:
    """Return the stretches in the order of pieces, and which of them begin one."""
    middle = _place(c, parts.contour, (parts.begin + parts.end) / 2.0)[:, lines.axis]
    strip = _strips_of(lines, parts.contour, middle)
    apart = np.ones(len(strip), np.bool_)  # a cut within a strip, beside its line, is none
    apart[1:] = (parts.contour[1:] != parts.contour[:-1]) | (strip[1:] != strip[:-1])
    first = np.flatnonzero(apart)
    ends = parts.end[np.append(first[1:], len(apart)) - 1]
    parts, strip = Stretches(parts.contour[first], parts.begin[first], ends), strip[first]
    order = np.lexsort((parts.begin, strip, parts.contour))
    contour, begin, end = parts.contour[order], parts.begin[order], parts.end[order]
    a, b = _place(c, contour, end)[:-1], _place(c, contour, begin)[1:]
    strip = strip[order]
    new = np.ones(len(order), np.bool_)
    length = np.linalg.norm(b - a, axis=1)
    same = (contour[1:] == contour[:-1]) & (strip[1:] == strip[:-1])
    new[1:] = ~(same & (length <= hop_mm))
    far = np.flatnonzero(same & new[1:] & (length <= INSIDE_HOP_MM - ASIDE_MM))
    far = far[np.isin(c.role[contour[far]], INFILL)]
    new[far + 1] = ~_stays_inside(walls, a[far], b[far])
    group = np.cumsum(new) - 1
    begins = np.flatnonzero(new)
    turn = np.lexsort((begin[begins], contour[begins]))  # pieces by where they begin
    rank = np.empty(len(turn), np.int64)
    rank[turn] = np.arange(len(turn))
    order = np.lexsort((begin, rank[group]))
    return Stretches(contour[order], begin[order], end[order]), new[order]


def _stays_inside(walls: Walls, begin: Floats, end: Floats) -> Flags:
    """Tell which hops (k, 3) to (k, 3) lead over no outer wall, however their ends are rounded."""
    step = end - begin
    aside = np.column_stack([-step[:, 1], step[:, 0], 0.0 * step[:, 2]])
    aside *= ASIDE_MM / np.linalg.norm(step, axis=1)[:, None]
    inside = np.ones(len(begin), np.bool_)
    for by in (-aside, 0.0 * aside, aside):
        inside &= bare_pairs(walls, INSIDE_HOP_MM, begin + by, end + by)
    return inside


def _strips_of(lines: CutLines, contour: Int32s, at: Floats) -> Ints:
    """Return between which lines of its contour each place along the axis lies, (k,)."""
    below = np.zeros(len(at), np.int64)
    first, count = lines.offsets[contour], np.diff(lines.offsets)[contour]
    for k in range(int(count.max(initial=0))):
        has = k < count
        below[has] += lines.at[first[has] + k] < at[has]
    return below


def _place(c: Contours, contour: Int32s, along: Floats) -> Floats:
    """Return where places along contours are, (k, 3) mm."""
    first, last = c.offsets[contour], c.offsets[contour + 1] - 1
    k = np.minimum(first + np.floor(along).astype(np.int64), last - 1)
    share = (along - (k - first))[:, None]
    return np.asarray(c.points[k] * (1.0 - share) + c.points[k + 1] * share)


@dataclass(frozen=True, slots=True)
class Cuts:
    """The places at which contours are cut."""

    before: Ints  # (k,) the point at which a stretch ends
    after: Ints  # (k,) and that at which the next stretch of its contour begins
    contour: Ints  # (k,) of the source


def cuts_of(pieces: Contours) -> Cuts:
    """Return the places at which contours are cut, by contour and along it."""
    if pieces.of is None or pieces.along is None:
        none = np.empty(0, np.int64)
        return Cuts(none, none, none)
    n = len(pieces.points)
    begins = np.zeros(n, np.bool_)
    begins[pieces.offsets[:-1]] = True
    begins |= pieces.extrusion == 0.0  # a hop leads to what begins there
    ends = np.append(begins[1:], True)
    of = np.repeat(pieces.of, np.diff(pieces.offsets)).astype(np.int64)
    begin, end = np.flatnonzero(begins), np.flatnonzero(ends)
    begin = begin[np.lexsort((pieces.along[begin], of[begin]))]
    end = end[np.lexsort((pieces.along[end], of[end]))]
    first = np.diff(of[begin], prepend=-1) != 0  # the contour's own begin is no cut
    last = np.diff(of[end], append=-1) != 0
    return Cuts(end[~last], begin[~first], of[end[~last]])


def weld_ages(pieces: Contours, plan: JointPlan) -> tuple[Floats, Cuts]:
    """Return the age of each cut's weld, s, (k,), and the cuts; 0: printed in one go."""
    cuts = cuts_of(pieces)
    passed = np.zeros(len(pieces.points))
    for actions in plan.heads:
        rows, times = _passed(pieces, actions)
        passed[rows] = times
    age = np.abs(passed[cuts.after] - passed[cuts.before])
    return np.where(age <= AT_ONCE_S, 0.0, age), cuts


def _passed(pieces: Contours, actions: HeadActions) -> tuple[Ints, Floats]:
    """Return the points of contours that a head prints, and when it is at each."""
    printed = np.flatnonzero(actions.kind == ActionKind.PRINT)
    sizes = np.diff(actions.path_offsets)[printed]
    contour = actions.contour[printed]
    as_listed = np.diff(pieces.offsets)[contour] == sizes  # a loop entered elsewhere is not cut
    printed, sizes, contour = printed[as_listed], sizes[as_listed], contour[as_listed]
    within = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    path = actions.path[np.repeat(actions.path_offsets[printed], sizes) + within]
    step = np.linalg.norm(np.diff(path, axis=0, prepend=path[:1]), axis=1)
    step[within == 0] = 0.0
    total = np.cumsum(step)
    begin = np.repeat(total[within == 0], sizes)
    length = np.repeat(total[np.cumsum(sizes) - 1], sizes) - begin
    share = (total - begin) / np.maximum(length, 1e-12)
    takes = (actions.end_s - actions.begin_s)[printed]
    times = np.repeat(actions.begin_s[printed], sizes) + share * np.repeat(takes, sizes)
    turned = np.repeat(actions.reversed[printed], sizes)
    back = np.repeat(sizes, sizes) - 1 - within
    return np.repeat(pieces.offsets[contour], sizes) + np.where(turned, back, within), times


def late_contours(pieces: Contours, plan: JointPlan, limit_s: float) -> Flags:
    """Tell which contours of the source have a weld older than a limit, (number of contours,)."""
    age, cuts = weld_ages(pieces, plan)
    late = np.zeros(int(pieces.sources.max(initial=-1)) + 1, np.bool_)
    late[cuts.contour[age > limit_s]] = True
    return late


def with_welds(cut: CutMetrics, pieces: Contours, plan: JointPlan) -> CutMetrics:
    """Return what is said of a plan's cuts, with how many are welds and how old these are."""
    age, _ = weld_ages(pieces, plan)
    old = age[age > 0.0]
    return {
        **cut,
        "welds": len(old),
        "weld_median_s": float(np.median(old)) if len(old) else 0.0,
        "weld_most_s": float(old.max(initial=0.0)),
    }
