"""How old the ends of cuts are when they are printed on to.

A *weld* is where two stretches of one contour meet that were not printed in one go. Its age is
the time from when the first of its two ends is printed until the other is, by the plan's times.
Within an action the nozzle is taken to move evenly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts.print.contours import Contours
from decmcts.print.metrics import CutMetrics
from decmcts.print.plan import ActionKind, HeadActions, JointPlan

AT_ONCE_S = 1e-3  # stretches printed so soon one after the other are one bead again

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


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


def late_contours(pieces: Contours, plan: JointPlan, limit_s: float) -> NDArray[np.bool_]:
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
