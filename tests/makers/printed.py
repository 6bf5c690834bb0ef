"""What of a print was printed more often than once, by what its controllers reported."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np

from decmcts.planning.running.recorded import Carried
from decmcts.print.contours import Contours, joined, taken
from sim.content.inventory import NO_MATCH, contour_segments
from sim.content.rest import extruded_by, lies_on, reached_before


def printed_twice(plans: Sequence[Carried]) -> int:
    """Return how many segments of the first plan's contours were printed again, in part or whole.

    Beads that were broken off do not count.
    """
    prints = [carried for carried in plans if carried.is_print]
    done = [
        taken(each.document.contours, np.array(rows, np.int64))
        for each in prints
        if (rows := [c for c, share in each.printed() if share == 1.0])
    ]
    return laid_twice(reduce(joined, done), prints[0].document.contours) if done else 0


def laid_twice(laid: Contours, whole: Contours) -> int:
    """Return how many segments lie where others lie, beyond what a print, cut or not, has there."""
    ours, due = contour_segments(laid), extruded_by(whole)
    found = lies_on(ours.at(np.flatnonzero(ours.extrusion > 0.0)), due)
    rows = np.flatnonzero(found.of != NO_MATCH)
    of, low = found.of[rows], found.low[rows]
    order, before = reached_before(of, low, found.high[rows])
    return int((before - low[order] > due.tolerance[of[order]]).sum())
