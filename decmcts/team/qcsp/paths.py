"""Where every crane is while it works, waits and steps aside: paths that keep their distance.

Given tasks whose pairs keep the temporal distance of `decmcts.team.qcsp.solver_kernels`,
paths for all cranes exist, idle ones included. Measure positions so that crane v
is moved left by spacing · v: then cranes may meet but not pass. Let crane v be,
at every moment, at the rightmost place from which some stop of its own or of a
crane left of it can just be reached or was just left: the maximum over stops
(place c, from b to e) of c - speed · (time until b, or since e), and of a floor
left of all. It never moves faster than the cranes do, being a maximum of
functions that don't; it never lies left of the path of crane v - 1, having all of
its terms; and during a stop of crane v it is there, since a stop of a crane u <= v
that would push it further right is one that is too near in time. (McShane's
extension of a Lipschitz function.)

From where it begins a crane runs to this path at full speed. While two cranes that
begin too near are not yet as far apart as their paths, the left one goes left at
full speed or the right one right, so they only move apart.
"""

from __future__ import annotations

import numpy as np

from decmcts.arrays import Floats, Int32s
from decmcts.formats.bare.qcsp import QcspProblem

_LEVEL = 1e-9  # bays; what is straight to this is one move


def paths_of(problem: QcspProblem, crane: Int32s, begin: Floats) -> tuple[Floats, ...]:
    """Return for each crane (k, 2) rows (time, position), straight in between.

    Parameters
    ----------
    crane, begin : (n,)
        Who does each task and when, in pairs as far apart in time as they must be.
    """
    end = begin + problem.duration
    last = float(end.max(initial=0.0))
    behind = min(problem.bay.min(initial=problem.start[0]), problem.start.min())  # left of all
    paths: list[Floats] = []
    left: Floats | None = None
    for v in range(problem.cranes):
        mine = np.flatnonzero(crane == v)
        stops = np.stack([begin[mine], end[mine], problem.bay[mine].astype(np.float64)], axis=1)
        if problem.ready[v] > 0.0:
            stops = np.vstack([[0.0, problem.ready[v], problem.start[v]], stops])
        stops = stops[np.argsort(stops[:, 0], kind="stable")]
        floor = float(behind - problem.spacing * (problem.cranes - 1 - v))
        path = _own_path(stops, floor, problem.travel, last)
        if left is not None:
            path = _extreme(path, left + np.array([0.0, problem.spacing]), np.maximum)
        left = path
        paths.append(_from_start(path, float(problem.start[v]), problem.travel))
    return tuple(paths)


def _own_path(stops: Floats, floor: float, travel: float, last: float) -> Floats:
    """Return the path of one crane by its own stops, (k, 3) rows (begin, end, place)."""
    points: list[tuple[float, float]] = []
    for k, (begin, end, place) in enumerate(stops):
        down = (place - floor) * travel
        if k == 0 and begin > 0.0:
            points.append((0.0, max(floor, place - begin / travel)))
            points.append((max(0.0, begin - down), points[0][1] if begin < down else floor))
        elif k > 0:
            _, before, place_before = stops[k - 1]
            lowest = max(floor, (place + place_before - (begin - before) / travel) / 2)
            points.append((before + (place_before - lowest) * travel, lowest))
            points.append((begin - (place - lowest) * travel, lowest))
        points += [(begin, place), (end, place)]
    if not points:
        return np.array([[0.0, floor], [last, floor]])
    end, place = points[-1]
    lowest = max(floor, place - (last - end) / travel)
    points += [(end + (place - lowest) * travel, lowest), (last, lowest)]
    path = np.array(points)
    times, first = np.unique(np.maximum.accumulate(path[:, 0]), return_index=True)
    return np.stack([times, path[first, 1]], axis=1)


def _extreme(one: Floats, other: Floats, choose: np.ufunc) -> Floats:
    """Return the larger, or the smaller, of two paths at every moment."""
    times = np.union1d(one[:, 0], other[:, 0])
    a, b = np.interp(times, *one.T), np.interp(times, *other.T)
    apart = a - b
    crossed = np.flatnonzero(apart[:-1] * apart[1:] < 0.0)
    share = apart[crossed] / (apart[crossed] - apart[crossed + 1])
    times = np.union1d(times, times[crossed] + share * np.diff(times)[crossed])
    found = choose(np.interp(times, *one.T), np.interp(times, *other.T))
    return _straightened(np.stack([times, found], axis=1))


def _straightened(path: Floats) -> Floats:
    """Return the path without rows on the line between the rows kept on both sides."""
    kept = [0]
    for k in range(1, len(path) - 1):
        (t0, x0), (t1, x1), (t2, x2) = path[kept[-1]], path[k], path[k + 1]
        if abs(x0 + (x2 - x0) * (t1 - t0) / (t2 - t0) - x1) > _LEVEL:
            kept.append(k)
    if len(path) > 1:
        kept.append(len(path) - 1)
    return path[kept]


def _from_start(path: Floats, start: float, travel: float) -> Floats:
    """Return the path joined at full speed from `start`."""
    last, gap = path[-1, 0], start - path[0, 1]
    if last == 0.0:
        return np.array([[0.0, start]])
    if gap == 0.0:
        return _straightened(np.vstack([[0.0, start], path[1:]]))
    there = start - np.sign(gap) * last / travel
    run = np.array([[0.0, start], [last, there]])
    return _extreme(run, path, np.maximum if gap > 0.0 else np.minimum)
