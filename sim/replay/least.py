"""The judge's model of motion: the least time an action can take, whatever a firmware does.

A speed is at most the feed and each axis' own limit, an acceleration at most the largest that
applies. At a vertex no axis changes its speed at once by more than its jerk; a reversal goes
through zero, so there each side counts for itself, and a move may begin from rest at its jerk.
Filament, retractions and wipes take more. So no action of a plan can be shorter.

References
----------
Marlin, `planner.cpp` (classic jerk, junction deviation).
"""

from __future__ import annotations

import math

import numpy as np

from decmcts.arrays import Flags, Floats
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.machine import MotionLimits
from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from sim.content.seams import laid_by
from sim.replay.compiled import compiled


def least_arrivals(
    document: PlanDocument, actions: HeadActions, source: PrintJob | None, *, rests: bool
) -> Floats:
    """Return the least seconds from the begin of its action to each point of a head's paths, (n,).

    Parameters
    ----------
    source : PrintJob | None
        States the feed and acceleration of travels, which a plan does not; None: only what
        every axis can counts for them.
    rests : bool
        Whether each action begins and ends at rest, as where a head may have to wait.
    """
    n = len(actions.path)
    if n < 2:
        return np.zeros(n)
    machine = document.machine
    limits = machine.limits_of(machine.head(actions.head))
    step = np.diff(actions.path, axis=0, prepend=actions.path[:1])  # that ends at each point
    length = np.linalg.norm(step, axis=1)
    unit = step / np.maximum(length, 1e-12)[:, None]
    speed = np.minimum(_feeds(document, actions, limits, source), share(limits.max_feed, unit))
    rate = _accelerations(document, actions, limits, source)
    rate = np.minimum(rate, share(limits.max_acceleration, unit))
    first = np.zeros(n, np.bool_)
    first[actions.path_offsets[:-1]] = True
    length[first] = 0.0
    stops = first if rests else np.arange(n) == 0
    passed = np.cumsum(
        least_times(
            length, unit, speed, rate, stops, np.array(limits.jerk[:3]), limits.junction_deviation
        )
    )
    return np.asarray(passed - np.repeat(passed[first], np.diff(actions.path_offsets)))


def with_waits(actions: HeadActions, arrivals: Floats) -> Floats:
    """Return arrivals at the points of a head's paths where each wait lasts as the plan says."""
    waits = np.flatnonzero(actions.kind == ActionKind.WAIT)
    waited = arrivals.copy()
    waited[actions.path_offsets[waits + 1] - 1] += actions.end_s[waits] - actions.begin_s[waits]
    return waited


def _feeds(
    document: PlanDocument, actions: HeadActions, limits: MotionLimits, source: PrintJob | None
) -> Floats:
    """Return the most speed of the segment that ends at each point, (n,); infinite: not known."""
    travel = math.inf
    if source is not None:
        settings = source.settings
        travel = max(settings.travel_feed or limits.travel_feed, settings.z_feed)
    prints = np.repeat(actions.kind == ActionKind.PRINT, np.diff(actions.path_offsets))
    due = print_feeds(document.contours, actions)
    return np.where(due > 0.0, due, np.where(prints, math.inf, travel))


def print_feeds(contours: Contours, actions: HeadActions) -> Floats:
    """Return the feed of the segment that ends at each point of a head's paths, (n,).

    NaN where none is printed, and where a path has not the points it should have.
    """
    feed = np.full(len(actions.path), np.nan)
    prints = np.flatnonzero(actions.kind == ActionKind.PRINT)
    first = actions.path_offsets[prints]
    sizes = actions.path_offsets[prints + 1] - first
    contour = actions.contour[prints]
    plain = (actions.entry[prints] == 0) & (sizes == np.diff(contours.offsets)[contour])
    begins, counts = first[plain], sizes[plain] - 1
    within = np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)
    goes_back = np.repeat(actions.reversed[prints[plain]], counts)
    nth = np.where(goes_back, np.repeat(counts, counts) - within, within + 1)
    rows = np.repeat(contours.offsets[contour[plain]], counts) + nth
    feed[np.repeat(begins, counts) + within + 1] = contours.feed[rows]
    for a in prints[actions.entry[prints] != 0].tolist():
        due = print_feed(contours, actions, a)
        begin, end = int(actions.path_offsets[a]), int(actions.path_offsets[a + 1])
        if len(due) == end - begin - 1:  # a wrong path is reported elsewhere
            feed[begin + 1 : end] = due
    return feed


def print_feed(contours: Contours, actions: HeadActions, action: int) -> Floats:
    """Return the feed of each segment in the traversal of a print action; none if it is wrong."""
    laid = laid_by(contours, actions, action)
    return np.empty(0) if isinstance(laid, str) else laid.feed


def _accelerations(
    document: PlanDocument, actions: HeadActions, limits: MotionLimits, source: PrintJob | None
) -> Floats:
    """Return the most acceleration of the segment that ends at each point, (n,); inf: not known.

    Within a contour the highest that is set for any of its segments; hops accelerate as travels.
    """
    contours, travelling = document.contours, np.inf
    if source is not None:
        travelling = max(source.settings.travel_acceleration, limits.travel_acceleration)
    stated = document.acceleration if source is None else source.accelerations
    most = np.full(len(contours), np.inf)
    if stated is not None and len(stated) == len(contours.points) and len(contours):
        own = np.where(stated > 0.0, stated, limits.acceleration)
        own[contours.extrusion == 0.0] = np.maximum(own[contours.extrusion == 0.0], travelling)
        own[contours.offsets[:-1]] = 0.0
        most = np.maximum.reduceat(own, contours.offsets[:-1])
    prints = np.flatnonzero(actions.kind == ActionKind.PRINT)
    owner = np.repeat(np.arange(len(actions)), np.diff(actions.path_offsets))
    each = np.full(len(actions), travelling)
    each[prints] = most[actions.contour[prints]]
    return np.asarray(each[owner], np.float64)


def share(limits: tuple[float, float, float, float], unit: Floats) -> Floats:
    """Return the largest value along each direction whose parts keep the limits of x, y and z."""
    return np.asarray((np.array(limits[:3]) / np.maximum(np.abs(unit), 1e-9)).min(axis=1))


@compiled
def least_times(
    length: Floats, unit: Floats, speed: Floats, rate: Floats, stops: Flags,
    jerk: Floats, deviation: float,
) -> Floats:  # fmt: skip
    """Return the least seconds of each segment, (n,).

    Segments without length take none. `stops` (n,) tells before which the head stands still.
    """
    n = len(length)
    begins, ends = np.zeros(n), np.zeros(n)  # the most speed at both ends of each segment
    free = np.zeros(n)  # that needs no look at the neighbours: from rest and to rest
    last, held = -1, True
    for i in range(n):
        held = held or stops[i]
        if length[i] <= 0.0:
            continue
        free[i] = from_rest(unit[i], speed[i], jerk, deviation)
        begins[i] = ends[i] = free[i]
        if last >= 0 and not held:
            reach = min(rate[last], rate[i])
            corner = corner_at_most(unit[last], unit[i], reach, jerk, deviation)
            corner = min(corner, speed[last], speed[i])
            ends[last], begins[i] = max(ends[last], corner), max(begins[i], corner)
        last, held = i, False
    later = 0.0
    for i in range(n - 1, -1, -1):
        if length[i] > 0.0:
            ends[i] = max(free[i], min(ends[i], later)) if later > 0.0 else ends[i]
            begins[i] = max(
                free[i], min(begins[i], np.sqrt(ends[i] ** 2 + 2 * rate[i] * length[i]))
            )
            later = begins[i]
    before = 0.0
    seconds = np.zeros(n)
    for i in range(n):
        if length[i] > 0.0:
            begins[i] = max(free[i], min(begins[i], before)) if before > 0.0 else begins[i]
            ends[i] = max(free[i], min(ends[i], np.sqrt(begins[i] ** 2 + 2 * rate[i] * length[i])))
            before = ends[i]
            seconds[i] = least_time(length[i], begins[i], ends[i], speed[i], rate[i])
    return seconds


@compiled
def from_rest(unit: Floats, speed: float, jerk: Floats, deviation: float) -> float:
    """Return the most speed at which a direction may begin from rest, and end at rest."""
    if deviation > 0.0:
        return 0.0
    for axis in range(3):
        if abs(unit[axis]) > 1e-9:
            speed = min(speed, jerk[axis] / abs(unit[axis]))
    return speed


@compiled
def corner_at_most(
    before: Floats, after: Floats, rate: float, jerk: Floats, deviation: float
) -> float:
    """Return the most speed at which one direction may become another."""
    if deviation > 0.0:
        cosine = min(1.0, max(-1.0, (before * after).sum()))
        half = np.sqrt((1.0 + cosine) / 2.0)  # sine of half the angle between the two
        if half > 1.0 - 1e-9:
            return np.inf
        return float(np.sqrt(rate * deviation * half / (1.0 - half)))
    most = np.inf
    for axis in range(3):
        change = abs(after[axis] - before[axis])
        if before[axis] * after[axis] < 0.0:
            change = max(abs(before[axis]), abs(after[axis]))
        if change > 1e-9:
            most = min(most, jerk[axis] / change)
    return most


@compiled
def least_time(length: float, begin: float, end: float, speed: float, rate: float) -> float:
    """Return the least seconds of a segment begun and ended at such speeds at the most."""
    if abs(begin**2 - end**2) > 2.0 * rate * length:
        return float(length / max(begin, end))
    top = min(speed, np.sqrt(rate * length + (begin**2 + end**2) / 2.0))
    ramps = (2.0 * top**2 - begin**2 - end**2) / (2.0 * rate)
    return float((2.0 * top - begin - end) / rate + max(0.0, length - ramps) / top)
