"""How much must still come after each turn of a joint order, head by head, on bare arrays.

The *tail* of a head at a turn is the longest path through the partial order from the end of
its last unit before that turn to the end of the print, the travel to its park included. A
head that is free at `free` there delays the print exactly if `free` + tail is more than the
makespan. Where it is less the head has slack.

References
----------
Balas & Vazacopoulos 1998, "Guided local search with shifting bottleneck for job shop
scheduling", Management Science 44(2): moves judged by heads and tails.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.compiled import kernel
from decmcts.team.engine.joint_kernels import NONE, Units, Visits
from decmcts.team.engine.replay_kernels import Marks
from decmcts.team.engine.spaces_kernels import Fleet, travel_seconds
from decmcts.team.engine.waits_kernels import AT_END, find_waits


@kernel
def share_at(unit: int, point: int, visits: Visits, units: Units) -> float:
    """Share of a unit's time after which vertex `point` of its contour was passed."""
    row = 2 * units.contour[unit] + units.reversed[unit]
    for k in range(visits.pieces.offsets[row], visits.pieces.offsets[row + 1]):
        if visits.pieces.point[k] == point:
            share: float = visits.pieces.share[k]
            return share
    return 1.0


@kernel
def longest_paths(visits: Visits, fleet: Fleet, units: Units) -> NDArray[np.float64]:
    """Return the longest path from the end of each unit to the end of all, (m,) seconds."""
    m, heads = units.used[0], len(fleet.parks)
    own, place = np.empty(m, np.int64), np.empty(len(visits.ends), np.int64)
    rows, counts = np.empty((heads, m), np.int64), np.zeros(heads, np.int64)
    for row in range(m):
        r = units.head[row]
        own[row], rows[r, counts[r]] = counts[r], row
        counts[r] += 1
        if units.contour[row] != NONE:
            place[units.contour[row]] = row
    after, point = find_waits(own, place, visits, fleet, units)
    way, behind = np.zeros(m), np.zeros(m)  # from the begin; what waits for the end
    for r in range(heads):
        if counts[r] > 0:
            u = rows[r, counts[r] - 1]
            behind[u] = travel_seconds(units.target[u], fleet.parks[r], fleet.travel[r])
    for row in range(m - 1, -1, -1):
        way[row] = max(way[row], units.end[row] - units.begin[row] + behind[row])
        if (after[row] != NONE).any():
            way[row] += fleet.rest_s
        if units.before[row] != NONE:
            behind[units.before[row]] = max(behind[units.before[row]], way[row])
        for s in range(heads):
            if after[row, s] == NONE:
                continue
            u = rows[s, after[row, s]]
            if point[row, s] == AT_END:
                behind[u] = max(behind[u], way[row])
            else:
                passed = share_at(u, point[row, s], visits, units)
                way[u] = max(way[u], passed * (units.end[u] - units.begin[u]) + way[row])
        c = units.contour[row]
        if c != NONE:
            for k in range(visits.lags.offsets[c], visits.lags.offsets[c + 1]):
                u = place[visits.lags.below[k]]
                behind[u] = max(behind[u], visits.lags.seconds[k] + way[row])
    return behind


@kernel
def find_tails(visits: Visits, fleet: Fleet, units: Units, marks: Marks) -> None:
    """Write the tail of every head at every turn to `marks.tail`; all turns must be known."""
    behind = longest_paths(visits, fleet, units)
    for turn in range(len(marks.used)):
        for r in range(len(fleet.parks)):
            u = marks.last[turn, r]
            marks.tail[turn, r] = behind[u] if u != NONE else 0.0
