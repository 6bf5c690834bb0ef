"""Contours cut into pieces, so that several heads can share what one contour covers.

A *piece* is one or more stretches of one contour, in the contour's own order, with hops so
short that the slicer would not retract. To all planners a piece is a contour. Where contours
are cut is decided in `decmcts.team.cutting`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from decmcts.print.contours import PER_CONTOUR, Contours, Role
from decmcts.print.cut_kernels import Stretches, cut_at_lines, points_of
from decmcts.print.job import PrintJob
from decmcts.print.metrics import CutMetrics

LEAST_MM = 0.4  # no stretch is shorter
OUTSIDE = (Role.EXTERNAL_PERIMETER, Role.TOP_SOLID_INFILL)  # what shows


@dataclass(frozen=True, slots=True)
class Lines:
    """Where contours are to be cut."""

    axis: int  # 0: at places along X, 1: along Y
    at: NDArray[np.float64]  # (k,) mm, ascending within each contour's
    offsets: NDArray[np.int64]  # (n + 1,) contour c is cut at at[offsets[c]:offsets[c + 1]]


@dataclass(frozen=True, slots=True)
class Grid:
    """The steps of a file: cuts lie on them, so that nothing is rounded twice."""

    xy: float = 1e3  # steps a mm
    e: float = 1e5  # steps a mm of filament


def cut_metrics(pieces: Contours) -> CutMetrics:
    """Return how many contours are cut, at how many places, and at how many of them outside."""
    of, hop = pieces.sources, pieces.extrusion == 0.0
    hop[pieces.offsets[:-1]] = False
    stretches = np.add.reduceat(hop.astype(np.int64), pieces.offsets[:-1]) + 1
    first = np.unique(of, return_index=True)[1]
    cuts = np.bincount(of, weights=stretches, minlength=int(of.max(initial=-1)) + 1)
    cuts = cuts[of[first]].astype(np.int64) - 1
    outside = np.isin(pieces.role[first], OUTSIDE)
    return {
        "contours": int((cuts > 0).sum()),
        "cuts": int(cuts.sum()),
        "outside": int(cuts[outside].sum()),
    }


def cut_job(
    job: PrintJob, lines: Lines, *, hop_mm: float, hop_feed: float, whole: NDArray[np.bool_],
    grid: Grid,
) -> tuple[PrintJob, NDArray[np.int64]]:  # fmt: skip
    """Return the job with its contours cut at lines.

    Parameters
    ----------
    hop_mm : float
        Stretches of one strip whose ends are no farther apart become one piece.
    hop_feed : float
        mm/s of these hops.
    whole : (n_points,) whether the segment ending at a point may be cut at its ends alone

    Returns
    -------
    tuple[PrintJob, NDArray[np.int64]]
        Also the point of the source at the end of the segment that each segment is a part of,
        (n_points,).
    """
    c = job.contours
    parts = cut_at_lines(c.points, c.offsets, lines.axis, lines.at, lines.offsets, whole, LEAST_MM)
    parts, first = _grouped(c, parts, lines, hop_mm)
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
    c: Contours, parts: Stretches, lines: Lines, hop_mm: float
) -> tuple[Stretches, NDArray[np.bool_]]:
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
    near = np.linalg.norm(b - a, axis=1) <= hop_mm
    new[1:] = ~(near & (contour[1:] == contour[:-1]) & (strip[1:] == strip[:-1]))
    group = np.cumsum(new) - 1
    begins = np.flatnonzero(new)
    turn = np.lexsort((begin[begins], contour[begins]))  # pieces by where they begin
    rank = np.empty(len(turn), np.int64)
    rank[turn] = np.arange(len(turn))
    order = np.lexsort((begin, rank[group]))
    return Stretches(contour[order], begin[order], end[order]), new[order]


def _strips_of(
    lines: Lines, contour: NDArray[np.int32], at: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Return between which lines of its contour each place along the axis lies, (k,)."""
    below = np.zeros(len(at), np.int64)
    first, count = lines.offsets[contour], np.diff(lines.offsets)[contour]
    for k in range(int(count.max(initial=0))):
        has = k < count
        below[has] += lines.at[first[has] + k] < at[has]
    return below


def _place(
    c: Contours, contour: NDArray[np.int32], along: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return where places along contours are, (k, 3) mm."""
    first, last = c.offsets[contour], c.offsets[contour + 1] - 1
    k = np.minimum(first + np.floor(along).astype(np.int64), last - 1)
    share = (along - (k - first))[:, None]
    return np.asarray(c.points[k] * (1.0 - share) + c.points[k + 1] * share)
