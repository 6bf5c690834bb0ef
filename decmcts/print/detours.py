"""Travels round outer walls: the bends that keep a travel inside the part.

How a way is found stands in `decmcts.print.detours_kernels`. A way is level and seen from
above; how high it must be to clear what is printed is decided where travels get their heights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Floats, Ints
from decmcts.print.contours import Contours
from decmcts.print.detours_kernels import MOST_BENDS, Loops, detours
from decmcts.print.walls import OUTER, has_walls, outer_walls
from decmcts.print.walls_kernels import (
    HEAD,
    LAYERS,
    PER_LAYER,
    SAME_Z_MM,
    Walls,
    Z,
    is_inside,
    over_walls,
)

LEAST_POINTS = 3  # of a loop
BETWEEN_PIECES_MM = 0.3  # of a loop that is printed in pieces
CLOSES_MM = 1.0  # between a loop's ends: slicers end one early, where the nozzle still oozes
SHARPEST = 0.5  # cosine of half a corner's turn below which its normal grows no longer


@dataclass(frozen=True, slots=True)
class Detours:
    """Ways of travels round the outer walls of a print, and what they may cost."""

    walls: Walls
    loops: Loops
    price: float  # a mm over walls is worth so many mm of travel beyond its own; 0: go straight
    least_mm: float = 0.0  # shorter travels go straight
    reach: tuple[float, float, float, float] = (-np.inf, -np.inf, np.inf, np.inf)  # x0, y0, x1, y1

    @staticmethod
    def of(contours: Contours, price: float, walls: Walls | None = None) -> Detours:
        """Return the ways of a print, with its outer `walls` where they are known; O(points)."""
        if walls is None:
            walls = outer_walls(contours)
        return Detours(walls, wall_loops(contours, walls), price)

    def bends(self, starts: Floats, goals: Floats) -> tuple[Floats, Ints]:
        """Return the bends (b, 2) of travels from starts to goals, (m, 3) each, offsets (m + 1,).

        A travel has none where it crosses no outer wall of its ends' layers, or where no way
        round is worth it.
        """
        counts = np.zeros(len(starts), np.int64)
        bends = np.empty((0, 2))
        if self.price > 0.0 and has_walls(self.walls) and len(starts):
            loops = self.loops
            mean = len(loops.points) // max(1, len(loops.first) - 1)
            most = int(np.diff(loops.offsets[loops.first]).max(initial=0))
            longest = 4 * max(mean, most) + 2 * MOST_BENDS
            start, goal = (np.ascontiguousarray(p, np.float64) for p in (starts, goals))
            far = np.flatnonzero(np.hypot(*(goal - start)[:, :2].T) >= self.least_mm)
            led = np.zeros(len(far), np.int64)
            bends = detours(self.walls, loops, self.price, start[far], goal[far], led, longest)
            bends, counts[far] = self._within_reach(bends, led)
        return bends, np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)

    def _within_reach(self, bends: Floats, counts: Ints) -> tuple[Floats, Ints]:
        """Return the bends and counts without those of travels that would leave the reach."""
        travel = np.repeat(np.arange(len(counts)), counts)
        low, high = np.array(self.reach[:2]), np.array(self.reach[2:])
        kept = np.ones(len(counts), np.bool_)
        kept[travel[((bends < low) | (bends > high)).any(axis=1)]] = False
        return bends[kept[travel]], np.where(kept, counts, 0)

    def over_walls_mm(self, starts: Floats, goals: Floats) -> float:
        """Return the length of the legs over outer walls of these travels, bends and all, mm.

        Counted as `decmcts.formats.gcode.controller.duration.travel_over` counts a file's.
        """
        bends, offsets = self.bends(starts, goals)
        return over_walls_mm(self.walls, starts, goals, bends, offsets)


def straight_over_walls_mm(walls: Walls, starts: Floats, goals: Floats) -> float:
    """Return the length of straight travels over outer walls, from starts to goals, (m, 3), mm."""
    return over_walls_mm(walls, starts, goals, np.empty((0, 2)), np.zeros(len(starts) + 1, int))


def over_walls_mm(
    walls: Walls,
    starts: Floats,
    goals: Floats,
    bends: Floats,
    offsets: Ints,
) -> float:
    """Return the length of legs over outer walls, mm, of travels by bends (b, 2), offsets (m + 1,).

    A leg is over walls if it crosses one of the layer where its travel starts, (m, 3), or ends.
    """
    counts = np.diff(offsets)
    travel = np.repeat(np.arange(len(starts)), counts + 1)  # of each leg
    first = np.concatenate([[0], np.cumsum(counts + 1)[:-1]]).astype(np.int64)[: len(starts)]
    inner = np.ones(len(travel), np.bool_)
    inner[first] = False
    begin, end = starts[travel], goals[travel]  # copies
    begin[inner, :2] = bends
    last = np.append(inner, False)[1:]  # none where there is no travel
    end[last, :2] = bends
    across = np.hypot(*(end - begin)[:, :2].T)
    return float(across[over_walls(walls, begin, end)].sum())


def wall_loops(contours: Contours, walls: Walls) -> Loops:
    """Return the outer walls as loops, by layer; O(points).

    Walls that a slicer prints piece by piece, one where the last ended, are one loop.
    """
    n_layers = int(walls[LAYERS])
    heights = walls[HEAD + Z : HEAD + PER_LAYER * n_layers : PER_LAYER]
    pieces = _pieces(contours)
    z = contours.start[pieces[:, 0], 2]
    layer = np.clip(np.searchsorted(heights, z - SAME_Z_MM), 0, n_layers - 1)
    by_layer = np.argsort(layer, kind="stable")
    pieces, layer = pieces[by_layer], layer[by_layer]
    first, end = contours.offsets[pieces[:, 0]], contours.offsets[pieces[:, 1] + 1]
    rings = [
        _ring(contours.points[a:b, :2]) for a, b in zip(first.tolist(), end.tolist(), strict=True)
    ]
    offsets = np.concatenate([[0], np.cumsum([len(r) for r in rings])]).astype(np.int64)
    made = [
        _of_ring(r, walls, HEAD + PER_LAYER * k) for r, k in zip(rings, layer.tolist(), strict=True)
    ]
    return Loops(
        np.concatenate([*rings, np.empty((0, 2))]),
        np.concatenate([*(m[0] for m in made), np.empty((0, 2))]),
        np.concatenate([*(m[1] for m in made), np.empty(0)]),
        offsets,
        np.array([m[2] for m in made], np.float64),
        np.array([[*r.min(axis=0), *r.max(axis=0)] for r in rings], np.float64).reshape(-1, 4),
        np.searchsorted(layer, np.arange(n_layers + 1)).astype(np.int64),
    )


def _pieces(contours: Contours) -> Ints:
    """Return the first and the last contour of each loop of outer walls, (l, 2)."""
    c = contours
    low = np.minimum.reduceat(c.points[:, 2], c.offsets[:-1])
    high = np.maximum.reduceat(c.points[:, 2], c.offsets[:-1])
    wall = np.isin(c.role, OUTER) & (high - low <= SAME_Z_MM)
    step = c.start[1:] - c.end[:-1]
    apart = np.hypot(*step[:, :2].T) > BETWEEN_PIECES_MM
    apart |= np.abs(step[:, 2]) > SAME_Z_MM
    begins = np.ones(len(c), np.bool_)
    begins[1:] = apart | ~wall[1:] | ~wall[:-1] | c.closed[1:] | c.closed[:-1]
    first = np.flatnonzero(begins)
    last = np.append(first[1:], len(c)) - 1
    size = c.offsets[last + 1] - c.offsets[first]
    closes = np.linalg.norm(c.end[last] - c.start[first], axis=1) <= CLOSES_MM
    kept = wall[first] & closes & (size >= LEAST_POINTS)
    return np.asarray(np.column_stack([first, last])[kept], np.int64)


def _ring(points: Floats) -> Floats:
    """Return the corners of a loop, none twice in a row."""
    apart = (points != np.roll(points, 1, axis=0)).any(axis=1)
    return points[apart] if apart.any() else points[:1]


def _of_ring(ring: Floats, walls: Walls, k: int) -> tuple[Floats, Floats, float]:
    """Return normals into the part, places along the loop and its length."""
    step = np.roll(ring, -1, axis=0) - ring
    length = np.maximum(np.hypot(*step.T), 1e-12)
    left = np.column_stack([-step[:, 1], step[:, 0]]) / length[:, None]
    longest = int(np.argmax(length))
    x, y = ring[longest] + 0.5 * step[longest] + 0.05 * left[longest]
    side = 1.0 if is_inside(walls, k, float(x), float(y)) else -1.0
    both = left + np.roll(left, 1, axis=0)
    size = np.hypot(*both.T)  # twice the cosine of half the turn
    straight = np.where(size[:, None] > 1e-9, both / np.maximum(size, 1e-9)[:, None], left)
    normal = side * straight / np.maximum(0.5 * size, SHARPEST)[:, None]
    along = np.concatenate([[0.0], np.cumsum(length)[:-1]])
    return normal, along, float(length.sum())
