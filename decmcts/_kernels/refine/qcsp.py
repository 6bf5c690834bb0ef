"""Cranes on one rail: an order of all tasks made a schedule, and annealing of such orders.

A schedule is an order of all tasks and a crane for each. Each task in turn begins
as early as its crane, what it rests on and the tasks placed before it allow.
Cranes v < w need w to be `spacing` · (w - v) bays further right at all times, so
task j of one crane begins after task i of another by at least the time in which
they can pass from i to j side by side: the temporal distance of Bierwirth &
Meisel. Distances between tasks in pairs are enough: `decmcts.team.qcsp.paths`
has the paths of the cranes and the proof.

The order of a *sweep* follows from who does what: all cranes go along the rail
the same way, the one ahead first (a unidirectional schedule).

References
----------
Bierwirth & Meisel 2009, "A fast heuristic for quay crane scheduling with
interference constraints", Journal of Scheduling 12, section 4; Sammarra et al.
2007 (moves on order and assignment).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel
from decmcts._kernels.random import below, length_up_to, uniform
from decmcts._kernels.sequence.borrowed import borrowed

SPREAD = 0.3  # what the mean end of the cranes counts beside the makespan
LONGEST_RUN = 8  # tasks of one crane that change hands together
NEAR = 12  # places, within which two tasks exchange their cranes
LONGEST_SHIFT = 32  # places a task moves in the order


class Yard(NamedTuple):
    """The problem as arrays; bays as numbers from 0."""

    duration: NDArray[np.float64]  # (n,)
    bay: NDArray[np.int32]  # (n,)
    pred_offsets: NDArray[np.int32]  # (n + 1,)
    preds: NDArray[np.int32]  # (m,) direct ones
    succ_offsets: NDArray[np.int32]  # (n + 1,)
    succs: NDArray[np.int32]  # (m,)
    before: NDArray[np.bool_]  # (n, n) row before column, direct or not
    ready: NDArray[np.float64]  # (q,)
    start: NDArray[np.int32]  # (q,)
    travel: float
    spacing: int
    bays: int


class Crew(NamedTuple):
    """One schedule in work."""

    order: NDArray[np.int32]  # (n,) all tasks, each after what it rests on
    crane: NDArray[np.int32]  # (n,) by task
    begin: NDArray[np.float64]  # (n,) by task
    end: NDArray[np.float64]  # (n,) by task
    # (q, bays) latest end + bay * travel of a crane's tasks at this bay or further right,
    # and end - bay * travel at this bay or further left; -inf: none
    rightward: NDArray[np.float64]
    leftward: NDArray[np.float64]
    at: NDArray[np.int32]  # (q,) bay of each crane's last task
    free: NDArray[np.float64]  # (q,) its end
    load: NDArray[np.float64]  # (q,) duration of all its tasks
    left: NDArray[np.float64]  # (q,) of those not placed yet


@kernel
def copied(crew: Crew) -> Crew:
    """Return the schedule with arrays of its own."""
    return Crew(
        crew.order.copy(), crew.crane.copy(), crew.begin.copy(), crew.end.copy(),
        crew.rightward.copy(), crew.leftward.copy(), crew.at.copy(), crew.free.copy(),
        crew.load.copy(), crew.left.copy(),
    )  # fmt: skip


@kernel
def _borrowed_yard(yard: Yard) -> Yard:
    """Return the problem with arrays that are not counted; valid while `yard` lives."""
    return Yard(
        borrowed(yard.duration), borrowed(yard.bay), borrowed(yard.pred_offsets),
        borrowed(yard.preds), borrowed(yard.succ_offsets), borrowed(yard.succs),
        borrowed(yard.before), borrowed(yard.ready), borrowed(yard.start), yard.travel,
        yard.spacing, yard.bays,
    )  # fmt: skip


@kernel
def _borrowed_crew(crew: Crew) -> Crew:
    """Return the schedule with arrays that are not counted; valid while `crew` lives."""
    return Crew(
        borrowed(crew.order), borrowed(crew.crane), borrowed(crew.begin), borrowed(crew.end),
        borrowed(crew.rightward), borrowed(crew.leftward), borrowed(crew.at), borrowed(crew.free),
        borrowed(crew.load), borrowed(crew.left),
    )  # fmt: skip


@kernel
def _reset(yard: Yard, crew: Crew) -> None:
    """Mutate `crew`: all cranes where they begin, nothing done."""
    crew.rightward[:] = -np.inf
    crew.leftward[:] = -np.inf
    for v in range(len(yard.ready)):
        crew.at[v], crew.free[v] = yard.start[v], yard.ready[v]
        if yard.ready[v] > 0.0:  # until then it stands there like one at work
            _occupy(yard, crew, v, yard.start[v], yard.ready[v])


@kernel
def _occupy(yard: Yard, crew: Crew, v: int, bay: int, end: float) -> None:
    """Mutate `crew`: crane v stands at the bay until `end`."""
    crew.at[v], crew.free[v] = bay, end
    # What it did before ended earlier by at least its travel from there.
    crew.rightward[v, : bay + 1] = end + bay * yard.travel
    crew.leftward[v, bay:] = end - bay * yard.travel


@kernel
def _earliest(yard: Yard, crew: Crew, j: int) -> float:
    """Return when task j can begin after all that is placed."""
    v, bay, travel = crew.crane[j], yard.bay[j], yard.travel
    begin: float = crew.free[v] + abs(bay - crew.at[v]) * travel
    for k in range(yard.pred_offsets[j], yard.pred_offsets[j + 1]):
        begin = max(begin, crew.end[yard.preds[k]])
    for w in range(v):
        gap = yard.spacing * (v - w)
        nearest = max(bay - gap + 1, 0)
        if nearest < yard.bays:
            begin = max(begin, crew.rightward[w, nearest] + (gap - bay) * travel)
    for w in range(v + 1, len(yard.ready)):
        gap = yard.spacing * (w - v)
        nearest = min(bay + gap - 1, yard.bays - 1)
        begin = max(begin, crew.leftward[w, nearest] + (gap + bay) * travel)
    return begin


@kernel
def weigh(yard: Yard, crew: Crew) -> float:
    """Mutate `crew.load`; return a cost that no order of each crane's tasks is below.

    A crane at least does its work and goes to the farthest of its bays.
    """
    q, makespan, ends = len(yard.ready), 0.0, 0.0
    crew.load[:] = 0.0
    crew.left[:] = 0.0  # here: the longest way
    for j in range(len(crew.crane)):
        v = crew.crane[j]
        crew.load[v] += yard.duration[j]
        crew.left[v] = max(crew.left[v], abs(yard.bay[j] - yard.start[v]) * yard.travel)
    for v in range(q):
        end = yard.ready[v] + crew.load[v] + crew.left[v]
        if crew.load[v] > 0.0:
            makespan = max(makespan, end)
        ends += end
    return makespan + SPREAD / q * ends


@kernel
def decode(yard: Yard, crew: Crew, limit: float) -> tuple[float, float]:
    """Mutate `crew`: set times; return cost and makespan, infinite where the cost is above `limit`.

    The cost is the makespan and `SPREAD` times the mean end of the cranes. Both are at
    least what follows if every crane does the rest of its work without a pause, which
    gives most poor schedules up early. O(n (q + bays)).
    """
    _reset(yard, crew)
    q = len(yard.ready)
    makespan, ends = 0.0, 0.0
    for v in range(q):
        crew.left[v] = crew.load[v]
        ends += yard.ready[v] + crew.load[v]
    weight = SPREAD / q
    for j in crew.order:
        v, begin = crew.crane[j], _earliest(yard, crew, j)
        end = begin + yard.duration[j]
        ends += begin - crew.free[v]
        crew.left[v] -= yard.duration[j]
        makespan = max(makespan, end + crew.left[v])
        if makespan + weight * ends > limit:
            return np.inf, np.inf
        crew.begin[j], crew.end[j] = begin, end
        _occupy(yard, crew, v, yard.bay[j], end)
    return makespan + weight * ends, makespan


@kernel
def order_sweep(
    yard: Yard,
    crew: Crew,
    sweep: NDArray[np.int32],
    rightward: bool,
    lists: NDArray[np.int32],
    missing: NDArray[np.int32],
) -> None:
    """Mutate `crew.order`: the tasks as cranes of a sweep meet them, the crane ahead first.

    `sweep` is all tasks along the rail. A crane whose next task rests on one not
    placed yet lets those behind it go first; where the precedence leads back along
    the rail so that none can go on, the first task that can does. `lists` (q, n + 2)
    and `missing` (n,) are scratch.
    """
    n, q, placed = len(sweep), len(yard.ready), 0
    lists[:, n:] = 0  # of each crane: tasks, then how many are placed and how many there are
    for j in sweep:
        v = crew.crane[j]
        lists[v, lists[v, n + 1]] = j
        lists[v, n + 1] += 1
        missing[j] = yard.pred_offsets[j + 1] - yard.pred_offsets[j]
    while placed < n:
        before = placed
        for rank in range(q):
            v = q - 1 - rank if rightward else rank
            while lists[v, n] < lists[v, n + 1]:
                j = lists[v, lists[v, n]]
                if missing[j] > 0:
                    break
                lists[v, n] += 1
                if missing[j] == 0:
                    placed = _place(yard, crew.order, missing, j, placed)
            if placed > before and rank > 0:
                break  # those ahead may go on
        if placed == before:
            for j in sweep:
                if missing[j] == 0:
                    placed = _place(yard, crew.order, missing, j, placed)
                    break


@kernel
def _place(
    yard: Yard, order: NDArray[np.int32], missing: NDArray[np.int32], j: int, placed: int
) -> int:
    """Mutate `order` and `missing`: task j is next; return how many are placed."""
    order[placed] = j
    missing[j] = -1
    for k in range(yard.succ_offsets[j], yard.succ_offsets[j + 1]):
        missing[yard.succs[k]] -= 1
    return placed + 1


@kernel
def _beside(state: NDArray[np.uint64], v: int, q: int) -> int:
    """Mutate `state`; return the crane right or left of v, v where there is none."""
    w = v + 1 if uniform(state) < 0.5 else v - 1
    return w if 0 <= w < q else v


@kernel
def _hand_over(
    crane: NDArray[np.int32], sweep: NDArray[np.int32], q: int, state: NDArray[np.uint64]
) -> bool:
    """Mutate `crane` and `state`: other cranes for some tasks; return whether any changed."""
    n, kind = len(sweep), below(state, 8)
    k = below(state, n)
    v = crane[sweep[k]]
    w = below(state, q) if kind == 0 else _beside(state, v, q)
    if kind < 4:
        crane[sweep[k]] = w
        return bool(w != v)
    if kind < 6:
        left = 1 + below(state, LONGEST_RUN)
        while k < n and left > 0:
            if crane[sweep[k]] == v:
                crane[sweep[k]] = w
                left -= 1
            k += 1
        return bool(w != v)
    other = k + 1 + below(state, NEAR)
    if other >= n:
        return False
    crane[sweep[k]] = crane[sweep[other]]
    crane[sweep[other]] = v
    return bool(crane[sweep[k]] != v)


@kernel
def _shift(yard: Yard, order: NDArray[np.int32], a: int, most: int, later: bool) -> bool:
    """Mutate `order`: move the task at place a by up to `most` places its precedence allows."""
    j, b = order[a], a
    if later:
        while b < len(order) - 1 and b - a < most and not yard.before[j, order[b + 1]]:
            order[b] = order[b + 1]
            b += 1
    else:
        while b > 0 and a - b < most and not yard.before[order[b - 1], j]:
            order[b] = order[b - 1]
            b -= 1
    order[b] = j
    return b != a


@kernel
def _rearrange(yard: Yard, crew: Crew, state: NDArray[np.uint64]) -> bool:
    """Mutate order, cranes and `state` by one move; return whether anything changed."""
    n, q, kind = len(crew.order), len(yard.ready), below(state, 8)
    a, changed = below(state, n), False
    j = crew.order[a]
    v = crew.crane[j]
    if kind < 4:
        w = below(state, q) if kind < 2 else _beside(state, v, q)
        crew.crane[j] = w
        changed = w != v
        other = a + 1 + below(state, NEAR)
        if kind == 3 and other < n and crew.crane[crew.order[other]] == w:
            crew.crane[crew.order[other]] = v
    if kind != 3:
        most = length_up_to(state, LONGEST_SHIFT)
        changed |= _shift(yard, crew.order, a, most, uniform(state) < 0.5)
    return changed


@kernel
def anneal_crews(
    yard: Yard,
    crew: Crew,
    best: tuple[NDArray[np.int32], NDArray[np.int32]],
    costs: NDArray[np.float64],
    sweep: NDArray[np.int32],
    rightward: bool,
    state: NDArray[np.uint64],
    heats: tuple[float, float],
    proposals: int,
) -> None:
    """Anneal a schedule between two temperatures; mutate all but yard, sweep and heats.

    With a `sweep` (n,) only cranes change and orders are those of `order_sweep`; with
    an empty one orders change too. `costs` (3,) is the cost at hand, and makespan and
    cost of the best, whose order and cranes are `best`: that of least makespan, of
    equal ones the cheapest. Schedules in work begin with `costs` infinite.
    """
    yard, crew, state = _borrowed_yard(yard), _borrowed_crew(crew), borrowed(state)
    n, q = len(crew.order), len(yard.ready)
    lists, missing = np.empty((q, n + 2), np.int32), np.empty(n, np.int32)
    order, crane = crew.order.copy(), crew.crane.copy()
    ratio = (heats[1] / heats[0]) ** (1.0 / proposals)
    heat = heats[0]
    for _ in range(proposals):
        heat *= ratio
        changed = (
            _hand_over(crew.crane, sweep, q, state) if len(sweep) else _rearrange(yard, crew, state)
        )
        if not changed and costs[0] < np.inf:
            continue
        limit = costs[0] - heat * math.log(uniform(state))
        cost, makespan = weigh(yard, crew), np.inf
        if cost <= limit:
            if len(sweep):
                order_sweep(yard, crew, sweep, rightward, lists, missing)
            cost, makespan = decode(yard, crew, limit)
        if cost > limit:
            crew.order[:], crew.crane[:] = order, crane
            continue
        order[:], crane[:] = crew.order, crew.crane
        costs[0] = cost
        if makespan < costs[1] or (makespan == costs[1] and cost < costs[2]):
            costs[1], costs[2] = makespan, cost
            best[0][:], best[1][:] = crew.order, crew.crane
