"""How much of a plan's travel leads over outer walls, found from its contours and paths alone.

Walls are lines here, one a segment, and travels lines that are met with them: a tree of boxes
finds what meets (shapely), no grid and no rule of the planner's. Each height has a strip of the
plane of its own, so that a travel is met with walls of its two layers only.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from decmcts.arrays import Floats, Ints
from decmcts.print.contours import Contours, Role
from decmcts.print.plan import ActionKind, HeadActions

OUTER = (Role.EXTERNAL_PERIMETER, Role.OVERHANG_PERIMETER)
SAME_Z_MM = 1e-6
END_MM = 0.05  # at both ends of a leg that may touch a wall: beads begin and end on walls
LEAST_MM = 1e-9


def over_walls_mm(contours: Contours, actions: HeadActions) -> float:
    """Return the length of the legs of travels that cross outer walls, in mm.

    Of travels between two prints, seen from above; a leg counts whole where it crosses a wall
    of the layer printed last or of the one printed next. Between epochs the source's own lines
    may move the head, so what a plan has there is not counted.
    """
    start, end, before, behind = _legs(contours, actions)
    legs, _ = crossed_by(contours, start, end, before, behind)
    return float(np.hypot(*(end - start)[np.unique(legs)].T).sum())


def crossed_by(
    contours: Contours, start: Floats, end: Floats, before: Floats, behind: Floats
) -> tuple[Ints, Ints]:
    """Return legs that cross outer walls, and the contours that these are of, (k,) each.

    Parameters
    ----------
    start, end : (l, 2)
        Of the legs, seen from above.
    before, behind : (l,)
        Heights of the two layers whose walls each leg is met with.
    """
    none = np.empty(0, np.int64), np.empty(0, np.int64)
    if not len(start):
        return none
    walls, height, owner = wall_lines(contours)
    if not len(walls):
        return none
    length = np.hypot(*(end - start).T)
    cut = (end - start) * (END_MM / np.maximum(length, LEAST_MM))[:, None]
    long = length > 2.0 * END_MM
    legs, ends = np.flatnonzero(long), shapely.get_coordinates(walls).reshape(-1, 2, 2)
    lines = np.stack([start + cut, end - cut], axis=1)[legs]
    every = np.concatenate([ends, lines])[:, :, 0]
    strip = float(every.max(initial=0.0) - every.min(initial=0.0)) + 1.0
    of_walls, last, following = _strips(height, before[legs], behind[legs])
    tree = shapely.STRtree(_moved(ends, strip * of_walls))
    asked = (_moved(lines, strip * at) for at in (last, following))
    leg, wall = np.hstack([tree.query(each, predicate="intersects") for each in asked])
    return legs[leg], owner[wall]


def _strips(*heights: Floats) -> list[Floats]:
    """Return for each height the number of its strip; those that are the same share one."""
    every = np.concatenate(heights)
    ranked = np.argsort(every, kind="stable")
    strip = np.empty(len(every))
    strip[ranked] = np.cumsum(np.diff(every[ranked], prepend=every[ranked[:1]]) > SAME_Z_MM)
    return np.split(strip, np.cumsum([len(each) for each in heights])[:-1])


def _moved(lines: Floats, along_x: Floats) -> NDArray[np.object_]:
    moved = lines.copy()
    moved[:, :, 0] += along_x[:, None]
    return np.asarray(shapely.linestrings(moved))


def _legs(contours: Contours, actions: HeadActions) -> tuple[Floats, Floats, Floats, Floats]:
    """Return begins and ends (l, 2) of legs that travel, and heights last and next printed (l,)."""
    owner = np.repeat(np.arange(len(actions)), np.diff(actions.path_offsets))
    prints = actions.kind == ActionKind.PRINT
    printing = np.flatnonzero(prints)
    step = np.flatnonzero(owner[1:] == owner[:-1])
    step = step[~prints[owner[step]]]
    ahead = np.searchsorted(printing, owner[step])  # prints before it
    step, ahead = (each[(ahead > 0) & (ahead < len(printing))] for each in (step, ahead))
    z = actions.path[:, 2]
    last, following = printing[ahead - 1], printing[ahead]
    epoch = contours.epoch[actions.contour]
    same = epoch[last] == epoch[following]
    step, last, following = step[same], last[same], following[same]
    start, end = actions.path[step, :2], actions.path[step + 1, :2]
    moves = (start != end).any(axis=1)
    before = z[actions.path_offsets[last + 1] - 1]
    behind = z[actions.path_offsets[following]]
    return start[moves], end[moves], before[moves], behind[moves]


def wall_lines(contours: Contours) -> tuple[NDArray[np.object_], Floats, Ints]:
    """Return the level segments of outer walls as lines, loops closed, heights, and contours."""
    owner = np.repeat(np.arange(len(contours)), np.diff(contours.offsets))
    outer = np.isin(contours.role, OUTER)
    along = np.flatnonzero((owner[1:] == owner[:-1]) & outer[owner[:-1]])
    loops = np.flatnonzero(outer & contours.closed)
    ends = np.stack(
        [
            np.concatenate([contours.points[along], contours.end[loops]]),
            np.concatenate([contours.points[along + 1], contours.start[loops]]),
        ],
        axis=1,
    )
    level = np.abs(ends[:, 0, 2] - ends[:, 1, 2]) <= SAME_Z_MM
    ends, owner = ends[level], np.concatenate([owner[along], loops])[level]
    return shapely.linestrings(ends[:, :, :2]), ends[:, 0, 2], owner
