"""Where the heads of a team rest so that what is below can cool, as actions of a plan.

Heads have no common clock. So only the time counts that a head spends itself after
another head's contour has surely ended. If that is too short, the head rests for what
is missing, at the place where it is to print.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.print.lags_kernels import Lags
from decmcts.print.plan import ACTION_END, NO_CONTOUR, ActionKind, HeadActions, JointPlan
from decmcts.team.engine.order import UnitOrder
from decmcts.team.engine.waits_kernels import Rests, UnitsWithWaits, let_cool
from decmcts.team.schedule.waits import LEAST_WAIT_S, STEP_S


def find_rests(
    order: UnitOrder, passing: NDArray[np.float64], seconds: NDArray[np.float64], lags: Lags
) -> tuple[NDArray[np.float64], Rests]:
    """Return when each unit begins, and where heads rest so that what is below can cool."""
    place = np.empty(len(lags.offsets) - 1, np.int64)
    printing = np.flatnonzero(order.contour >= 0)
    place[order.contour[printing]] = printing
    rows = UnitsWithWaits(
        order.head, order.kind, order.contour, order.own, order.rows, order.after, order.point
    )
    found: tuple[NDArray[np.float64], Rests] = let_cool(
        rows, passing, seconds, place, lags, LEAST_WAIT_S, STEP_S
    )
    return found


def with_rests(plan: JointPlan, order: UnitOrder, rests: Rests) -> JointPlan:
    """Return the plan with the heads' rests as waits, and what they rest for."""
    mine_of = [order.rows[r, : order.counts[r]] for r in range(len(order.counts))]
    resting = [rests.seconds[rows] > 0.0 for rows in mine_of]
    shifted = [np.arange(len(mine)) + np.cumsum(mine) for mine in resting]
    count = int(rests.used[0])
    row, other = rests.row[:count], rests.other[:count]
    unit, first = rests.unit[:count], rests.first[:count]
    all_actions = []
    for r, (head, rows) in enumerate(zip(plan.heads, mine_of, strict=True)):
        mine, at = resting[r], shifted[r]
        edges = [
            (int(at[k]), g, int(shifted[g][a]), point)
            for k in np.flatnonzero(np.diff(head.after_offsets)).tolist()
            for g, a, point, _ in head.after_edges(k)
        ]
        cooling = np.flatnonzero(order.head[row] == r)
        edges += [
            (int(at[order.own[row[i]]]) - int(first[i]), int(other[i]),
             int(shifted[int(other[i])][unit[i]]), ACTION_END)
            for i in cooling.tolist()
        ]  # fmt: skip
        all_actions.append(
            _rested(head, mine, rests.begin[rows], rests.seconds[rows], sorted(edges))
        )
    return JointPlan(tuple(all_actions))


def _rested(
    head: HeadActions,
    resting: NDArray[np.bool_],
    begin: NDArray[np.float64],
    seconds: NDArray[np.float64],
    edges: list[tuple[int, int, int, int]],
) -> HeadActions:
    """Return the actions of one head with a wait before each of those that rest.

    `edges` are action, other head, its action and its point, by the new actions' numbers.
    """
    repeats = 1 + resting.astype(np.int64)
    was = np.repeat(np.arange(len(resting)), repeats)
    waits = np.zeros(len(was), np.bool_)
    waits[np.cumsum(repeats)[resting] - 2] = True
    counts = np.where(waits, 1, np.diff(head.path_offsets)[was])
    offsets = np.cumsum([0, *counts]).astype(np.int64)
    source = np.arange(offsets[-1]) - np.repeat(offsets[:-1], counts)
    source += np.repeat(head.path_offsets[was], counts)
    action, g, a, point = (
        np.array(column, np.int64) for column in (zip(*edges, strict=True) if edges else ((),) * 4)
    )
    return HeadActions(
        head=head.head,
        kind=np.where(waits, ActionKind.WAIT, head.kind[was]).astype(np.int8),
        contour=np.where(waits, NO_CONTOUR, head.contour[was]).astype(np.int32),
        reversed=head.reversed[was] & ~waits,
        entry=np.where(waits, 0, head.entry[was]).astype(np.int32),
        path_offsets=offsets,
        path=head.path[source],
        begin_s=np.where(waits, begin[was], head.begin_s[was]),
        end_s=np.where(waits, begin[was] + seconds[was], head.end_s[was]),
        after_offsets=np.searchsorted(action, np.arange(len(was) + 1)).astype(np.int64),
        after_head=g.astype(np.int32),
        after_action=a.astype(np.int32),
        after_point=point.astype(np.int32),
        after_lag_s=np.zeros(len(edges)),
    )
