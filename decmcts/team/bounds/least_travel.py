"""The least time heads spend between contours: shares of travels that every plan has to pay.

For bounds. Each contour has a share of the travel that leaves it and a share of the one that
enters it. For any two contours that one head may print one after the other, the share of leaving
the first and that of entering the second are together no more than the travel between them takes.
So whatever the plan, a head spends the one share after the first contour and the other before the
second, and nothing is counted twice. Only a head's first and last contour may go without a
share.

Travels to near contours are listed; for all others there is a limit to each share. Shares are half
of the shortest travel, or more where the contours it leads to have less: 2 to 7 % below the best
such shares, the dual of an assignment problem.

No travel of a head that rests between contours takes less than `FastestTravel.seconds`, by the
times of `decmcts.team.schedule.timing`. Two contours may have others that must be printed between
them. Then some head prints these meanwhile, and the time this takes counts as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from decmcts.arrays import Flags, Floats, Ints
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.motion import travel_acceleration
from decmcts.print.seam import SeamEntries, entry_points, exit_points
from decmcts.print.walls_kernels import SAME_Z_MM
from decmcts.search.bounds.chains_kernels import FAR, UNRELATED, ancestry
from decmcts.team.schedule.timing import habit_of

NEAR = 200  # ends of contours that are looked at from each end
MOST_PAIRS = 4_000_000  # of ends; of large prints fewer ends are looked at from each
LEAST_NEAR = 8
ROUNDING = 1e-9  # mm


@dataclass(frozen=True, slots=True)
class FastestTravel:
    """How fast the fastest head of a machine travels, or faster."""

    speed: float  # mm/s along the path
    acceleration: float  # mm/s²
    corner: float  # mm/s at which it may leave rest, and come to it
    bare_mm: float  # longer travels are retracted
    retraction_s: float

    @staticmethod
    def of(job: PrintJob, machine: Machine) -> FastestTravel:
        """Return the pace of a machine's heads with this print."""
        settings, speed, rate, corner, retraction = job.settings, 0.0, 0.0, 0.0, np.inf
        all_limits = {machine.limits_of(head) for head in machine.heads}
        for of_tool, limits in product(settings.each(), all_limits):
            habit = habit_of(of_tool, limits)
            wipes = habit.wipe_mm > 0.0
            speed = max(speed, habit.feed, habit.z_feed, habit.wipe_feed if wipes else 0.0)
            rate = max(rate, travel_acceleration(of_tool, limits))
            rate = max(rate, limits.acceleration if wipes else 0.0)
            if limits.junction_deviation <= 0.0:
                corner = max(corner, float(np.linalg.norm(limits.jerk[:3])))
            pushed = ((habit.pull_mm, habit.pull_feed), (habit.push_mm, habit.push_feed))
            retraction = min(retraction, sum(mm / feed for mm, feed in pushed if feed > 0.0))
        inside = settings.bare_inside_mm
        inside = float(np.hypot(inside, settings.bare_climb_mm + SAME_Z_MM)) if inside > 0 else 0.0
        bare = max(settings.retract_min_travel_mm, inside)
        return FastestTravel(speed, rate, min(corner, speed), bare, retraction)

    def seconds(self, length: Floats) -> Floats:
        """Return what a head takes at least to get so far, mm, with stops on the way or without.

        One that stops may go without retraction if each stretch is short enough for that.
        """
        straight = self._moving(length)
        retracted = length > max(self.bare_mm, 0.0) + ROUNDING
        straight = straight + np.where(retracted, self.retraction_s, 0.0)
        if self.bare_mm <= 0.0:
            return straight
        stretches = np.floor(length / self.bare_mm)
        longest = float(self._moving(np.array([self.bare_mm]))[0])
        rest = self._moving(np.maximum(length - stretches * self.bare_mm, 0.0))
        return np.minimum(straight, stretches * longest + rest)

    def _moving(self, length: Floats) -> Floats:
        """Return the seconds of moves that begin and end at the speed of corners."""
        a, v, s = self.acceleration, self.speed, self.corner
        peak = np.minimum(np.sqrt(a * length + s * s), v)
        ramps = (peak * peak - s * s) / a
        return np.asarray(2.0 * (peak - s) / a + np.maximum(length - ramps, 0.0) / v)

    def reach(self, seconds: Floats) -> Floats:
        """Return how far a head is at most so long after it stood still, mm."""
        far = self.corner * seconds + 0.5 * self.acceleration * seconds * seconds
        return np.asarray(np.minimum(far, self.speed * seconds))


@dataclass(frozen=True, slots=True)
class TravelShares:
    """Seconds that heads spend at least between contours, and where."""

    leaving: Floats  # (n,) after each contour, before its head begins another
    entering: Floats  # (n,) before it, since its head ended another
    pace: FastestTravel

    def without(self, heads: int) -> float:
        """Return what the first and the last contours of so many heads may go without."""
        return heads * float(self.leaving.max(initial=0.0) + self.entering.max(initial=0.0))

    def spent(self, heads: int, contours: Flags | slice = slice(None)) -> float:
        """Return what so many heads spend at least between contours of these."""
        both = self.leaving[contours] + self.entering[contours]
        return max(float(both.sum()) - self.without(heads), 0.0)


def no_shares(contours: int) -> TravelShares:
    """Return shares of nothing."""
    nothing = np.zeros(contours)
    return TravelShares(nothing, nothing, FastestTravel(1.0, 1.0, 0.0, 0.0, 0.0))


def travel_shares(
    job: PrintJob,
    machine: Machine,
    graph: DependencyGraph,
    seconds: Floats,
    entries: SeamEntries | None = None,
) -> TravelShares:
    """Return shares of the travels between contours, for heads that rest between them.

    O(n log n).

    Parameters
    ----------
    seconds : (n,)
        What printing each contour takes at least.
    entries : SeamEntries | None
        Where loops may be entered besides as sliced; None: nowhere.
    """
    n, pace, heads = len(job.contours), FastestTravel.of(job, machine), len(machine.heads)
    if n < 2:
        return no_shares(n)
    outs, ins = ends_of(job.contours, entries)
    pairs = _near_pairs(outs, ins, n, pace)
    kept, wait = _possible(pairs, graph, seconds)
    least = np.maximum(pairs.seconds, wait)[kept]
    tail, head = pairs.tail[kept], pairs.head[kept]
    leaving, entering = _shares(tail, head, least, pairs.leaving, pairs.entering)
    return TravelShares(_even(leaving, heads), _even(entering, heads), pace)


@dataclass(frozen=True, slots=True)
class Ends:
    """Points at which contours may be left, or entered."""

    points: Floats  # (k, 3) mm
    contour: Ints  # (k,)


def ends_of(contours: Contours, entries: SeamEntries | None) -> tuple[Ends, Ends]:
    """Return where contours may be left, and where they may be entered."""
    n = len(contours)
    every = np.arange(n)
    reversible = np.flatnonzero(contours.reversible)
    outs = [contours.end, contours.start[reversible]]
    ins = [contours.start, contours.end[reversible]]
    owner = [every, reversible]
    if entries is not None:
        moved = entries.vertices > 0
        both = [found(contours, entries)[moved] for found in (entry_points, exit_points)]
        outs, ins = outs + both, ins + both
        owner += [entries.contour()[moved].astype(np.int64)] * 2
    contour = np.concatenate(owner)
    return Ends(np.concatenate(outs), contour), Ends(np.concatenate(ins), contour)


@dataclass(frozen=True, slots=True)
class _Pairs:
    """Different contours near to each other, and what is left for all others."""

    tail: Ints  # (m,)
    head: Ints  # (m,)
    seconds: Floats  # (m,) of the shortest travel from the one to the other
    leaving: Floats  # (n,) shares that keep to all travels
    entering: Floats  # (n,) to contours that are not listed


def _near_pairs(outs: Ends, ins: Ends, n: int, pace: FastestTravel) -> _Pairs:
    """Return the pairs whose travel takes less than what is left for its two ends.

    To a contour not listed it is as far as to the last that was looked at, or farther, seen from
    either end: half the one and half the other are no more than it takes.
    """
    count = max(LEAST_NEAR, min(NEAR, MOST_PAIRS // len(ins.points)))
    count = min(count, len(ins.points))
    far, after = _nearest(outs, ins, count)
    back, before = _nearest(ins, outs, count)
    leaving = 0.5 * pace.seconds(_least_of(outs.contour, far[:, -1], n))
    entering = 0.5 * pace.seconds(_least_of(ins.contour, back[:, -1], n))
    tail = np.concatenate([np.repeat(outs.contour, count), before.ravel()])
    head = np.concatenate([after.ravel(), np.repeat(ins.contour, count)])
    seconds = pace.seconds(np.concatenate([far.ravel(), back.ravel()]))
    binds = np.flatnonzero((seconds < leaving[tail] + entering[head]) & (tail != head))
    tail, head, seconds = tail[binds], head[binds], seconds[binds]
    pair = tail * n + head
    order = np.argsort(pair, kind="stable")
    begins = np.flatnonzero(np.diff(pair[order], prepend=-1))
    first, least = order[begins], np.minimum.reduceat(seconds[order], begins)
    return _Pairs(tail[first], head[first], least, leaving, entering)


def _nearest(ends: Ends, others: Ends, count: int) -> tuple[Floats, Ints]:
    """Return how far the nearest others are from each end, mm, and their contours, (k, count)."""
    wanted = np.arange(count) + 1
    length, found = cKDTree(others.points).query(ends.points, wanted, workers=-1)
    return np.asarray(length), others.contour[found]


def _least_of(contour: NDArray[Any], values: Floats, n: int) -> Floats:
    """Return the least of the values of each contour, infinite where it has none, (n,)."""
    least = np.full(n, np.inf)
    np.minimum.at(least, contour, values)
    return least


def _possible(pairs: _Pairs, graph: DependencyGraph, seconds: Floats) -> tuple[Flags, Floats]:
    """Tell which contours a head may print one after the other, and what it must wait, (m,) each.

    Other contours may have to be printed between the two: one that lies on the first, and one
    that the second lies on, or a single one that is both. The wait is the longer of their times.
    """
    n = graph.n
    earlier, later = np.minimum(pairs.tail, pairs.head), np.maximum(pairs.tail, pairs.head)
    order = np.argsort(later, kind="stable")
    offsets = np.concatenate([[0], np.cumsum(np.bincount(later, minlength=n))]).astype(np.int64)
    kind = np.empty(len(order), np.int8)
    kind[order] = ancestry(
        offsets, earlier[order].astype(np.int32), graph.pred_offsets, graph.preds
    )
    forwards = pairs.tail == earlier
    first, second = graph.pairs().T
    behind = _least_of(first, seconds[second], n)
    before = _least_of(second, seconds[first], n)
    wait = np.maximum(behind[pairs.tail], before[pairs.head])
    return forwards | (kind == UNRELATED), np.where(kind == FAR, wait, 0.0)


def _shares(
    tail: Ints,
    head: Ints,
    least: Floats,
    most_leaving: Floats,
    most_entering: Floats,
) -> tuple[Floats, Floats]:
    """Return what is left for each contour of the travels that leave and enter it, (n,) each.

    First half of the shortest, then what the other ends leave.
    """
    leaving, entering = most_leaving.copy(), most_entering.copy()
    np.minimum.at(leaving, tail, 0.5 * least)
    np.minimum.at(entering, head, least - leaving[tail])
    leaving = most_leaving.copy()
    np.minimum.at(leaving, tail, least - entering[head])
    return leaving, entering


def _even(shares: Floats, heads: int) -> Floats:
    """Lower the largest shares, one a head, to the next one; so going without them costs less."""
    if len(shares) <= heads:
        return np.zeros(len(shares))
    return np.asarray(np.minimum(shares, np.partition(shares, -heads - 1)[-heads - 1]))
