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

from decmcts.arrays import Flags, Floats, Int32s
from decmcts.compiled import kernel
from decmcts.random_kernels import below, length_up_to, uniform
from decmcts.search.sequence.borrowed_kernels import borrowed

SPREAD = 0.3  # what the mean end of the cranes counts beside the makespan
LONGEST_RUN = 8  # tasks of one crane that change hands together
NEAR = 12  # places, within which two tasks exchange their cranes
LONGEST_SHIFT = 32  # places a task moves in the order


class CraneProblem(NamedTuple):
    """The problem as arrays; bays are numbered from 0."""

    duration: Floats  # (n,)
    bay: Int32s  # (n,)
    pred_offsets: Int32s  # (n + 1,)
    preds: Int32s  # (m,) direct ones
    succ_offsets: Int32s  # (n + 1,)
    succs: Int32s  # (m,)
    before: Flags  # (n, n) row before column, direct or not
    ready: Floats  # (q,)
    start: Int32s  # (q,)
    travel: float
    spacing: int
    bays: int


class CraneSchedule(NamedTuple):
    """One schedule, changed in place."""

    order: Int32s  # (n,) all tasks, each after what it rests on
    crane: Int32s  # (n,) by task
    begin: Floats  # (n,) by task
    end: Floats  # (n,) by task
    # (q, bays) latest end + bay * travel of a crane's tasks at this bay or further right,
    # and end - bay * travel at this bay or further left; -inf: none
    rightward: Floats
    leftward: Floats
    at: Int32s  # (q,) bay of each crane's last task
    free: Floats  # (q,) its end
    load: Floats  # (q,) duration of all its tasks
    left: Floats  # (q,) of those not placed yet


@kernel
def _reset(problem: CraneProblem, schedule: CraneSchedule) -> None:
    """Mutate `schedule`: all cranes where they begin, nothing done."""
    schedule.rightward[:] = -np.inf
    schedule.leftward[:] = -np.inf
    for v in range(len(problem.ready)):
        schedule.at[v], schedule.free[v] = problem.start[v], problem.ready[v]
        if problem.ready[v] > 0.0:  # until then it stands there like one at work
            _occupy(problem, schedule, v, problem.start[v], problem.ready[v])


@kernel
def _occupy(problem: CraneProblem, schedule: CraneSchedule, v: int, bay: int, end: float) -> None:
    """Mutate `schedule`: crane v stands at the bay until `end`."""
    schedule.at[v], schedule.free[v] = bay, end
    # What it did before ended earlier by at least its travel from there.
    schedule.rightward[v, : bay + 1] = end + bay * problem.travel
    schedule.leftward[v, bay:] = end - bay * problem.travel


@kernel
def _earliest(problem: CraneProblem, schedule: CraneSchedule, j: int) -> float:
    """Return when task j can begin after all that is placed."""
    v, bay, travel = schedule.crane[j], problem.bay[j], problem.travel
    begin: float = schedule.free[v] + abs(bay - schedule.at[v]) * travel
    for k in range(problem.pred_offsets[j], problem.pred_offsets[j + 1]):
        begin = max(begin, schedule.end[problem.preds[k]])
    for w in range(v):
        gap = problem.spacing * (v - w)
        nearest = max(bay - gap + 1, 0)
        if nearest < problem.bays:
            begin = max(begin, schedule.rightward[w, nearest] + (gap - bay) * travel)
    for w in range(v + 1, len(problem.ready)):
        gap = problem.spacing * (w - v)
        nearest = min(bay + gap - 1, problem.bays - 1)
        begin = max(begin, schedule.leftward[w, nearest] + (gap + bay) * travel)
    return begin


@kernel
def find_loads(problem: CraneProblem, schedule: CraneSchedule) -> float:
    """Mutate `schedule.load`; return a bound on the cost, whatever the order of the tasks.

    A crane does all its work and goes to the farthest of its bays at least.
    """
    q, makespan, ends = len(problem.ready), 0.0, 0.0
    schedule.load[:] = 0.0
    schedule.left[:] = 0.0  # here: the longest way
    for j in range(len(schedule.crane)):
        v = schedule.crane[j]
        schedule.load[v] += problem.duration[j]
        schedule.left[v] = max(
            schedule.left[v], abs(problem.bay[j] - problem.start[v]) * problem.travel
        )
    for v in range(q):
        end = problem.ready[v] + schedule.load[v] + schedule.left[v]
        if schedule.load[v] > 0.0:
            makespan = max(makespan, end)
        ends += end
    return makespan + SPREAD / q * ends


@kernel
def decode(problem: CraneProblem, schedule: CraneSchedule, limit: float) -> tuple[float, float]:
    """Mutate `schedule`: set times; return cost and makespan, infinite if the cost is over `limit`.

    The cost is the makespan plus `SPREAD` times the mean end of the cranes. After each task
    both are bounded from below as if every crane did the rest of its work without a pause, so
    most poor schedules are given up early. O(n (q + bays)).
    """
    _reset(problem, schedule)
    q = len(problem.ready)
    makespan, ends = 0.0, 0.0
    for v in range(q):
        schedule.left[v] = schedule.load[v]
        ends += problem.ready[v] + schedule.load[v]
    weight = SPREAD / q
    for j in schedule.order:
        v, begin = schedule.crane[j], _earliest(problem, schedule, j)
        end = begin + problem.duration[j]
        ends += begin - schedule.free[v]
        schedule.left[v] -= problem.duration[j]
        makespan = max(makespan, end + schedule.left[v])
        if makespan + weight * ends > limit:
            return np.inf, np.inf
        schedule.begin[j], schedule.end[j] = begin, end
        _occupy(problem, schedule, v, problem.bay[j], end)
    return makespan + weight * ends, makespan


@kernel
def order_sweep(
    problem: CraneProblem,
    schedule: CraneSchedule,
    sweep: Int32s,
    rightward: bool,
    lists: Int32s,
    missing: Int32s,
) -> None:
    """Mutate `schedule.order`: the tasks as cranes of a sweep meet them, the crane ahead first.

    `sweep` is all tasks along the rail. A crane whose next task rests on one not
    placed yet lets those behind it go first; where the precedence leads back along
    the rail so that none can go on, the first task that can does. `lists` (q, n + 2)
    and `missing` (n,) are scratch.
    """
    n, q, placed = len(sweep), len(problem.ready), 0
    lists[:, n:] = 0  # of each crane: tasks, then how many are placed and how many there are
    for j in sweep:
        v = schedule.crane[j]
        lists[v, lists[v, n + 1]] = j
        lists[v, n + 1] += 1
        missing[j] = problem.pred_offsets[j + 1] - problem.pred_offsets[j]
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
                    placed = _place(problem, schedule.order, missing, j, placed)
            if placed > before and rank > 0:
                break  # those ahead may go on
        if placed == before:
            for j in sweep:
                if missing[j] == 0:
                    placed = _place(problem, schedule.order, missing, j, placed)
                    break


@kernel
def _place(problem: CraneProblem, order: Int32s, missing: Int32s, j: int, placed: int) -> int:
    """Mutate `order` and `missing`: task j is next; return how many are placed."""
    order[placed] = j
    missing[j] = -1
    for k in range(problem.succ_offsets[j], problem.succ_offsets[j + 1]):
        missing[problem.succs[k]] -= 1
    return placed + 1


@kernel
def _adjacent_crane(state: NDArray[np.uint64], v: int, q: int) -> int:
    """Mutate `state`; return the crane right or left of v, v where there is none."""
    w = v + 1 if uniform(state) < 0.5 else v - 1
    return w if 0 <= w < q else v


@kernel
def _reassign(crane: Int32s, sweep: Int32s, q: int, state: NDArray[np.uint64]) -> bool:
    """Mutate `crane` and `state`: other cranes for some tasks; return whether any changed."""
    n, kind = len(sweep), below(state, 8)
    k = below(state, n)
    v = crane[sweep[k]]
    w = below(state, q) if kind == 0 else _adjacent_crane(state, v, q)
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
def _shift(problem: CraneProblem, order: Int32s, a: int, most: int, later: bool) -> bool:
    """Mutate `order`: move the task at place a by up to `most` places its precedence allows."""
    j, b = order[a], a
    if later:
        while b < len(order) - 1 and b - a < most and not problem.before[j, order[b + 1]]:
            order[b] = order[b + 1]
            b += 1
    else:
        while b > 0 and a - b < most and not problem.before[order[b - 1], j]:
            order[b] = order[b - 1]
            b -= 1
    order[b] = j
    return b != a


@kernel
def _rearrange(problem: CraneProblem, schedule: CraneSchedule, state: NDArray[np.uint64]) -> bool:
    """Mutate order, cranes and `state` by one move; return whether anything changed."""
    n, q, kind = len(schedule.order), len(problem.ready), below(state, 8)
    a, changed = below(state, n), False
    j = schedule.order[a]
    v = schedule.crane[j]
    if kind < 4:
        w = below(state, q) if kind < 2 else _adjacent_crane(state, v, q)
        schedule.crane[j] = w
        changed = w != v
        other = a + 1 + below(state, NEAR)
        if kind == 3 and other < n and schedule.crane[schedule.order[other]] == w:
            schedule.crane[schedule.order[other]] = v
    if kind != 3:
        most = length_up_to(state, LONGEST_SHIFT)
        changed |= _shift(problem, schedule.order, a, most, uniform(state) < 0.5)
    return changed


@kernel
def anneal_schedule(
    problem: CraneProblem,
    schedule: CraneSchedule,
    best: tuple[Int32s, Int32s],
    costs: Floats,
    sweep: Int32s,
    rightward: bool,
    state: NDArray[np.uint64],
    temperatures: tuple[float, float],
    proposals: int,
) -> None:
    """Anneal a schedule between two temperatures; mutate all but problem, sweep and temperatures.

    With a `sweep` (n,) only cranes change and orders are those of `order_sweep`; with
    an empty one orders change too. `costs` (3,) is the cost at hand, and makespan and
    cost of the best, whose order and cranes are `best`: that of least makespan, of
    equal ones the cheapest. `costs` are infinite at the first call.
    """
    problem, schedule, state = borrowed(problem), borrowed(schedule), borrowed(state)
    n, q = len(schedule.order), len(problem.ready)
    lists, missing = np.empty((q, n + 2), np.int32), np.empty(n, np.int32)
    order, crane = schedule.order.copy(), schedule.crane.copy()
    ratio = (temperatures[1] / temperatures[0]) ** (1.0 / proposals)
    temperature = temperatures[0]
    for _ in range(proposals):
        temperature *= ratio
        changed = (
            _reassign(schedule.crane, sweep, q, state)
            if len(sweep)
            else _rearrange(problem, schedule, state)
        )
        if not changed and costs[0] < np.inf:
            continue
        limit = costs[0] - temperature * math.log(uniform(state))
        cost, makespan = find_loads(problem, schedule), np.inf
        if cost <= limit:
            if len(sweep):
                order_sweep(problem, schedule, sweep, rightward, lists, missing)
            cost, makespan = decode(problem, schedule, limit)
        if cost > limit:
            schedule.order[:], schedule.crane[:] = order, crane
            continue
        order[:], crane[:] = schedule.order, schedule.crane
        costs[0] = cost
        if makespan < costs[1] or (makespan == costs[1] and cost < costs[2]):
            costs[1], costs[2] = makespan, cost
            best[0][:], best[1][:] = schedule.order, schedule.crane
