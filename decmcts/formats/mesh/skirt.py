"""A skirt: loops around the first layer that fill the nozzle before the part begins."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from decmcts.formats.mesh.options import Bed, SliceOptions
from decmcts.formats.mesh.toolpaths import Bead
from decmcts.print.contours import Role


def skirt_beads(region: BaseGeometry, options: SliceOptions) -> Iterator[Bead]:
    """Yield the loops, the outer ones first, as many as the bed has room for.

    Where the bed is too small for the distance, loops come as near as two bead widths.
    """
    hull, width = shapely.convex_hull(region), options.bead_width
    room = _room(hull, options.bed) - width / 2.0
    nearest = min(options.skirt_distance, room - (options.skirts - 1) * width)
    if options.center is None:  # where the bed is, is not known
        nearest = options.skirt_distance
    if nearest < 2.0 * width:
        return
    for loop in reversed(range(options.skirts)):
        ring = hull.buffer(nearest + loop * width, quad_segs=8).exterior
        yield Bead(Role.SKIRT_BRIM, np.asarray(shapely.get_coordinates(ring)))


def _room(hull: BaseGeometry, bed: Bed) -> float:
    """Return how far the hull may grow before it leaves the bed, mm."""
    x0, y0, x1, y1 = hull.bounds
    return float(min(x0 - bed.low[0], y0 - bed.low[1], bed.high[0] - x1, bed.high[1] - y1))
