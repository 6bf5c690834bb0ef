"""Whether a plan for one head prints over any spot too soon.

The plan names a rule: no contour begins over another within so many seconds of
its end, or within the pause that the source made between the last of what is
under it and its begin where that is less. Of the source's time only what it
printed in between counts here, so the judge asks for no more than is due. Times
are those of the judge's own motion model; retractions are no motion, and slicers set
accelerations for single lines that a plan does not carry, so an action may take as
long as the plan says within reason.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.plan import ActionKind, HeadActions, OrderRules, PlanDocument
from sim.faults import Fault, FaultKind, listed

SLACK_S = 0.5
SLACK = 0.1  # share of what is due that the models may differ by
TRAVEL_MORE_S = 1.0  # what a travel may take beyond its motion, retracting and priming
TIE_MM = 1e-4  # heights and distances nearer than this are equal
TRAVEL_TIMES = 15.0  # and how much slower than the machine can the source may travel,
PRINT_TIMES = 3.0  # or print: short lines at a ninth of the machine's acceleration

Floats = NDArray[np.float64]


def check_cooling(
    document: PlanDocument, lanes: tuple[HeadActions, ...], arrivals: list[Floats]
) -> list[Fault]:
    """Check the plan's rule; `arrivals` are the seconds to each point of each head's paths.

    Several heads keep no time among each other: a rule there is a fault.
    """
    rule = document.min_layer_time_s
    if rule <= 0.0:
        return []
    busy = [h for h, lane in enumerate(lanes) if (lane.kind == ActionKind.PRINT).any()]
    if len(busy) > 1:
        text = f"a rule of {rule:g} s is only kept by one head, {len(busy)} print"
        return [Fault(FaultKind.COOLING, text)]
    lines: list[str] = []
    for h in busy:
        lines += _too_soon(document, lanes[h], arrivals[h])
    return listed(FaultKind.COOLING, lines)


def check_stated(document: PlanDocument, source: PrintJob, held: OrderRules) -> list[Fault]:
    """Check that a plan states no less time than its source's slicer keeps.

    That rule counts as `decmcts plan` takes it: with quality, on a machine of one head.
    """
    due, stated = source.settings.min_layer_time_s, document.min_layer_time_s
    if stated >= due or not held.quality or len(document.machine.heads) > 1:
        return []
    text = (
        f"the plan states {f'{stated:g} s' if stated else 'no time'} before a spot is printed "
        f"over, the source's slicer {due:g} s; --min-layer-time {stated:g}, if that was asked for"
    )
    return [Fault(FaultKind.COOLING, text)]


def _too_soon(document: PlanDocument, lane: HeadActions, arrivals: Floats) -> list[str]:
    contours, rule = document.contours, document.min_layer_time_s
    seconds = _seconds(lane, arrivals)
    end = np.cumsum(seconds)
    rows = np.flatnonzero(lane.kind == ActionKind.PRINT)
    printed, ended, begun = lane.contour[rows], end[rows], end[rows] - seconds[rows]
    work = np.zeros(len(contours))
    work[printed] = seconds[rows]
    before = np.concatenate([[0.0], np.cumsum(work)])  # printed before each contour, as sliced
    first = np.searchsorted(ended, begun - rule, side="right")
    top, floor = contours.top, contours.bottom - contours.height
    lines = []
    for i in range(len(rows)):
        b = int(printed[i])
        recent = printed[first[i] : i]
        half = contours.height[b] / 2
        meets = _ends_under(top[recent] - floor[b], half)
        for k in np.flatnonzero(meets & (recent < b)).tolist():
            a, gap = int(recent[k]), float(begun[i] - ended[first[i] + k])
            due = min(rule, float(before[b] - before[a + 1]))
            if gap >= due - SLACK_S - SLACK * due or not _over(contours, a, b):
                continue
            under = a + 1 + np.flatnonzero(_ends_under(top[a + 1 : b] - floor[b], half))
            last = next((c for c in under[::-1].tolist() if _over(contours, c, b)), a)
            due = min(rule, float(before[b] - before[last + 1]))
            if gap < due - SLACK_S - SLACK * due:
                lines.append(
                    f"contour {b} begins {gap:.1f} s after contour {a} under it, "
                    f"{due:.1f} s are due"
                )
    return lines


def _seconds(lane: HeadActions, arrivals: Floats) -> Floats:
    """Return how long each action takes."""
    own = arrivals[lane.path_offsets[1:] - 1]
    stated = lane.end_s - lane.begin_s
    travel = (lane.kind == ActionKind.TRAVEL) | (lane.kind == ActionKind.PARK)
    most = np.where(travel, TRAVEL_TIMES * own + TRAVEL_MORE_S, PRINT_TIMES * own)
    moves = travel | (lane.kind == ActionKind.PRINT)
    return np.where(moves, np.maximum(own, np.minimum(stated, most)), own)


def _ends_under(above_floor: Floats, half: float) -> NDArray[np.bool_]:
    """Say whether what ends so far above a bead's underside is right under that bead.

    `half` is half the bead's height. A bridge of twice the layer's height begins within
    the layer that carries it.
    """
    return (above_floor > TIE_MM - half) & (above_floor < half + TIE_MM)


def _over(contours: Contours, a: int, b: int) -> bool:
    """Say whether one's centreline runs over the other's bead."""
    one, other = (shapely.LineString(contours.polyline(c)[:, :2]) for c in (a, b))
    reach = max(float(contours.width[a]), float(contours.width[b])) / 2 + TIE_MM
    return bool(shapely.dwithin(one, other, reach))
