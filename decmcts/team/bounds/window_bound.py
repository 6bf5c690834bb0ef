"""The most work in a window that only one head fits into at a time.

A window is a part of the bed so small that any two nozzles in it are too near to each
other, whatever the heads. So at most one head prints there at every moment, and a plan takes
at least as long as all printing in the window, whoever does it and however room is released.
Shapes are exact, as the judge has them, not boxes as in `decmcts.team.engine.space`: two
round heads fit diagonally into a window that their boxes fill.

A segment's time is taken to lie evenly along it. Heads are slower near its ends, so of
segments that a window cuts it may count a little more than is spent in it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.print.machine import Head, Machine

CELL_MM = 0.5  # windows begin at multiples of it
MOST_CELLS = 1000  # along an axis; cells grow beyond
MOST_SAMPLES = 4_000_000  # of all paths together
TOUCH_MM = 1e-3  # heads that only touch may pass
DISC = 32  # corners of the polygon that stands for a disc
Floats = NDArray[np.float64]


def window_of(machine: Machine, height_mm: float) -> Floats:
    """Return the size along x and y of the largest window that only one head fits into, (2,).

    For prints of this height; 0 where there is none.
    """
    size = np.full(2, np.inf)
    for r in range(len(machine.heads)):
        for s in range(r + 1, len(machine.heads)):
            found = _sizes(machine, r, s, height_mm)
            if not len(found):
                return np.zeros(2)
            size = np.minimum(size, found[np.minimum(found, 1e4).prod(axis=1).argmax()])
    return np.maximum(size - TOUCH_MM, 0.0)


def _sizes(machine: Machine, r: int, s: int, height_mm: float) -> Floats:
    """Return sizes of windows that two heads do not fit into at once, (k, 2)."""
    sizes = [np.empty((0, 2))]
    names = (machine.heads[r].name, machine.heads[s].name)
    for rail in machine.rails:
        if set(names) <= set(rail.order):
            size = np.full((1, 2), np.inf)
            steps = abs(rail.order.index(names[0]) - rail.order.index(names[1]))
            size[0, rail.axis] = steps * rail.separation_mm
            sizes.append(size)
    sizes += [
        _too_near(one.outline, other.outline, machine.head_clearance_mm)
        for one in _parts(machine.heads[r])
        for other in _parts(machine.heads[s])
        if min(one.high - other.low, other.high - one.low) >= height_mm
    ]
    found = np.concatenate(sizes)
    return found[(found > TOUCH_MM).all(axis=1)]


class _Part(NamedTuple):
    """A convex part of a head: its outline, (k, 2), and from where to where it goes up, mm."""

    outline: Floats
    low: float
    high: float


def _parts(head: Head) -> list[_Part]:
    """Return the slices of a head, which go up for ever, and its bodies."""
    parts = [_Part(p, cut.height_mm, np.inf) for cut in head.slices for p in cut.polygons]
    for body in head.bodies:
        (x0, y0, z0), (x1, y1, z1) = body.minimum, body.maximum
        parts.append(_Part(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]), z0, z1))
    return parts


def _too_near(one: Floats, other: Floats, gap: float) -> Floats:
    """Return sizes of windows in which two outlines are always less than `gap` apart, (k, 2).

    They are so where the difference of the nozzles is in the Minkowski sum of the first, the
    second mirrored and a disc. Here a regular polygon within the disc stands for it.
    """
    turn = 2.0 * np.pi / DISC * np.arange(DISC)
    outlines = (one, -other, gap * np.column_stack([np.cos(turn), np.sin(turn)]))
    sides = np.concatenate([np.roll(outline, -1, axis=0) - outline for outline in outlines])
    sides = sides[(sides != 0.0).any(axis=1)]
    normal = np.column_stack([sides[:, 1], -sides[:, 0]]) / np.linalg.norm(sides, axis=1)[:, None]
    normal = np.concatenate([normal, -normal])
    far = np.sum([(outline @ normal.T).max(axis=0) for outline in outlines], axis=0)
    return _largest(np.abs(normal), far)


def _largest(slope: Floats, most: Floats) -> Floats:
    """Return sizes w >= 0 with slope @ w <= most, the largest by area among them, (k, 2).

    It is in the middle of a side of what is feasible, or where two of them meet.
    """
    i, j = np.triu_indices(len(most), 1)
    area = slope[i, 0] * slope[j, 1] - slope[j, 0] * slope[i, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        x = (most[i] * slope[j, 1] - most[j] * slope[i, 1]) / area
        y = (most[j] * slope[i, 0] - most[i] * slope[j, 0]) / area
        sizes = np.concatenate([np.column_stack([x, y]), 0.5 * most[:, None] / slope])
    sizes = sizes[np.isfinite(sizes).all(axis=1) & (sizes >= 0.0).all(axis=1)]
    feasible = (sizes @ slope.T <= most + 1e-6).all(axis=1)
    return np.asarray(sizes[feasible])


def window_bound(points: Floats, seconds: Floats, size: Floats) -> float:
    """Return the most seconds of printing in any window of a size.

    Parameters
    ----------
    points : (m, 3) mm, contour after contour
    seconds : (m,) of the segment that ends at each point, 0 at the first of a contour
    size : (2,) mm, along x and y
    """
    ends = np.flatnonzero(seconds > 0.0)
    ends = ends[ends > 0]
    if not len(ends) or not (size > 0.0).all():
        return 0.0
    first, last = points[ends - 1, :2], points[ends, :2]
    length = np.linalg.norm(last - first, axis=1)
    low = points[:, :2].min(axis=0)
    extent = np.ptp(points[:, :2], axis=0)
    cell = max(CELL_MM, float(extent.max()) / MOST_CELLS)
    step = max(cell / 4, float(length.sum()) / MOST_SAMPLES)
    wide = np.floor((np.minimum(size, extent + 2 * cell + step) - step) / cell).astype(np.int64)
    if (wide < 1).any():
        return 0.0
    parts = np.maximum(np.ceil(length / step), 1.0).astype(np.int64)
    owner = np.repeat(np.arange(len(ends)), parts)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(parts) - parts, parts)
    share = (place + 0.5) / parts[owner]
    middle = first[owner] + share[:, None] * (last - first)[owner]
    at = np.floor((middle - low) / cell).astype(np.int64)
    shape = np.floor(extent / cell).astype(np.int64) + 1
    work = np.zeros(shape + 1)
    np.add.at(work, tuple((at + 1).T), (seconds[ends] / parts)[owner])
    total = work.cumsum(axis=0).cumsum(axis=1)
    x, y = np.minimum(wide, shape)
    inside = total[x:, y:] - total[:-x, y:] - total[x:, :-y] + total[:-x, :-y]
    return float(inside.max())
