"""What a run has printed, and what of it more often than once, by its controllers' reports."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np

from decmcts.planning.running.recorded import Carried
from decmcts.print.contours import Contours, joined, taken
from decmcts.print.loops import as_printed
from decmcts.print.plan import ActionKind, HeadActions
from decmcts.print.print_state import HeadState, rest_of_line
from sim.content.inventory import NO_MATCH, contour_segments
from sim.content.rest import extruded_by, lies_on, reached_before


def printed(carried: Carried) -> list[tuple[int, float]]:
    """Return the contours that are printed of a plan, and of each which share of all it lays."""
    found = list[tuple[int, float]]()
    for place, head in enumerate(carried.heads):
        actions, state = carried.document.plan.heads[place], carried.state(head)
        rows = actions.kind[: state.ended] == ActionKind.PRINT
        found += [(c, 1.0) for c in actions.contour[: state.ended][rows].tolist()]
        k = state.ended
        if state.begun and state.is_exact and k < len(actions) and actions.contour[k] >= 0:
            share = _share(carried.document.contours, actions, k, state)
            found.append((int(actions.contour[k]), share))
    return found


def _share(contours: Contours, actions: HeadActions, k: int, state: HeadState) -> float:
    """Return which share of what an action lays down is laid, where its head has stopped."""
    run = as_printed(
        contours, int(actions.contour[k]), int(actions.entry[k]), reverse=bool(actions.reversed[k])
    )
    steps = np.linalg.norm(np.diff(run.points, axis=0), axis=1) * (run.extrusion[1:] > 0.0)
    assert state.at is not None  # it is exact
    point, share = rest_of_line(run.points, state.point, state.at)
    done = steps[:point].sum() + share * steps[point : point + 1].sum()
    return float(done / max(steps.sum(), 1e-9))


def printed_mm(plans: Sequence[Carried]) -> float:
    """Return the length of all that is printed, broken beads up to their break."""
    length = 0.0
    for carried in plans:
        contours = carried.document.contours
        for c, share in printed(carried) if carried.is_print else ():
            rows = slice(int(contours.offsets[c]), int(contours.offsets[c + 1]))
            steps = np.linalg.norm(np.diff(contours.points[rows], axis=0), axis=1)
            length += share * float(steps[contours.extrusion[rows][1:] > 0.0].sum())
    return length


def printed_twice(plans: Sequence[Carried]) -> int:
    """Return how many segments of the first plan's contours were printed again, in part or whole.

    Beads that were broken off do not count.
    """
    prints = [carried for carried in plans if carried.is_print]
    done = [
        taken(each.document.contours, np.array(rows, np.int64))
        for each in prints
        if (rows := [c for c, share in printed(each) if share == 1.0])
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
