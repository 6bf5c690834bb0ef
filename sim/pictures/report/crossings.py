"""Where travels of a plan cross outer walls: which travels, and which walls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from decmcts._kernels.geometry.walls import END_MM, Walls, over_walls
from decmcts.print.contours import Contours
from decmcts.print.plan import ActionKind, HeadActions
from decmcts.print.walls import OUTER
from sim.arrays import Flags, Floats, Ints

STRIP = np.array([1e5, 0.0])  # mm, more than any bed: each level has a part of the plane
NO_POINTS = np.zeros((0, 3))
Points = Floats


@dataclass(frozen=True, slots=True)
class Legs:
    """Straight parts of a head's travels that cross an outer wall of the layer of either end.

    Each end has the height of its end of the action: lifts are looked at from above.
    """

    action: Ints  # (k,) they belong to
    start: Points  # (k, 3)
    goal: Points  # (k, 3)


def legs_over(walls: Walls, actions: HeadActions) -> Legs:
    """Return what a head moves over outer walls without printing."""
    owner = np.repeat(np.arange(len(actions)), np.diff(actions.path_offsets))
    legs = np.flatnonzero((owner[1:] == owner[:-1]) & (actions.kind[owner[1:]] != ActionKind.PRINT))
    start, goal = actions.path[legs].copy(), actions.path[legs + 1].copy()
    start[:, 2] = actions.path[actions.path_offsets[owner[legs]], 2]
    goal[:, 2] = actions.path[actions.path_offsets[owner[legs] + 1] - 1, 2]
    over = over_walls(walls, start, goal)
    return Legs(owner[legs[over]], start[over], goal[over])


def crossed_walls(contours: Contours, legs: Sequence[Legs]) -> Flags:
    """Tell which contours are outer walls that any of the legs crosses, (n,)."""
    crossed = np.zeros(len(contours), np.bool_)
    start = np.concatenate([NO_POINTS, *(each.start for each in legs)])
    goal = np.concatenate([NO_POINTS, *(each.goal for each in legs)])
    outer = np.flatnonzero(np.isin(contours.role, OUTER) & (np.diff(contours.offsets) > 1))
    if not len(start) or not len(outer):
        return crossed
    cut = goal[:, :2] - start[:, :2]
    cut *= (END_MM / np.maximum(np.hypot(*cut.T), END_MM))[:, None]
    ways = np.stack([start[:, :2] + cut, goal[:, :2] - cut], axis=1)
    heights = np.concatenate([contours.start[outer, 2], start[:, 2], goal[:, 2]])
    level = np.unique(heights.round(6), return_inverse=True)[1].ravel()
    of_walls, *of_ends = np.split(level, [len(outer), len(outer) + len(start)])
    tree = shapely.STRtree(_lines(contours, outer, of_walls))
    for level in of_ends:
        strips = shapely.linestrings(ways + level[:, None, None] * STRIP)
        crossed[outer[tree.query(strips, predicate="intersects")[1]]] = True
    return crossed


def _lines(contours: Contours, rows: Ints, level: Ints) -> NDArray[np.object_]:
    """Return contours as lines in the strips of their levels, closed where they are loops."""
    sizes = np.diff(contours.offsets)[rows]
    owner = np.repeat(np.arange(len(rows)), sizes)
    shift = contours.offsets[rows] - (np.cumsum(sizes) - sizes)
    points = contours.points[np.arange(len(owner)) + np.repeat(shift, sizes)]
    loops = np.flatnonzero(contours.closed[rows])
    owner = np.concatenate([owner, loops])
    points = np.concatenate([points, contours.start[rows[loops]]])[:, :2]
    ranked = np.argsort(owner, kind="stable")
    moved = points[ranked] + level[owner[ranked], None] * STRIP
    return np.asarray(shapely.linestrings(moved, indices=owner[ranked]))
