"""Does one convex part of a head, moved along a straight line, meet one bead? The exact check.

A bead segment fills, at each point of its centreline, the disc of half its width
from its height below the nozzle's way up to it; so its ends are round. With a bead point
q(s) and a nozzle point p(t), 0 <= s, t <= 1, the part meets it iff q_xy - p_xy lies
within `reach` of the part's polygon while q_z is above the part's underside (and the
bead's underside below the part's top). Both q - p and the heights are linear in (s, t),
so what is left of the parallelogram of all q - p is a convex polygon, and the answer is
the distance of two convex polygons in the plane.
"""

from __future__ import annotations

from itertools import pairwise

import shapely

Point = tuple[float, float, float]


def meets(
    move: tuple[Point, Point],
    bead: tuple[Point, Point],
    bead_height: float,
    polygon: shapely.Polygon,
    span: tuple[float, float],
    *,
    reach: float,
    tolerance_mm: float,
) -> bool:
    """Tell whether part and bead overlap by more than the tolerance.

    Parameters
    ----------
    move, bead : start and end of the nozzle's way, and of the bead's centreline
    bead_height : mm that the bead fills below its centreline
    polygon : the part seen from above, the nozzle at the origin
    span : heights above the nozzle between which the part fills the polygon
    reach : half the bead's width and the clearance kept from it, mm
    tolerance_mm : overlap that counts as touching
    """
    (p, p_end), (q, q_end) = move, bead
    corners = [_minus(a, b) for a, b in ((q, p), (q_end, p), (q_end, p_end), (q, p_end))]
    low, high = span[0] + tolerance_mm, span[1] + bead_height - tolerance_mm
    if max(c[2] for c in corners) <= low or min(c[2] for c in corners) >= high:
        return False
    left = _below(_above(corners, low), high)
    if not left or reach <= tolerance_mm:
        return False
    shape = shapely.MultiPoint([c[:2] for c in left]).convex_hull
    return bool(shapely.distance(shape, polygon) < reach - tolerance_mm)


def _minus(a: Point, b: Point) -> Point:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _above(corners: list[Point], level: float) -> list[Point]:
    """Return the part of a convex polygon in space that is not below a level."""
    kept: list[Point] = []
    for a, b in pairwise([*corners, corners[0]]) if corners else ():
        if a[2] >= level:
            kept.append(a)
        if (a[2] - level) * (b[2] - level) < 0.0:
            share = (level - a[2]) / (b[2] - a[2])
            kept.append((a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), level))
    return kept


def _below(corners: list[Point], level: float) -> list[Point]:
    """Return the part of a convex polygon in space that is not above a level."""
    turned = _above([(x, y, -z) for x, y, z in corners], -level)
    return [(x, y, -z) for x, y, z in turned]
