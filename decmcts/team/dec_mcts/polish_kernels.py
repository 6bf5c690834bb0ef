"""Local search on one order of everything that several heads do, on bare arrays.

A move takes a run of contours that one head prints one after the other and puts it
before or behind another contour: on that contour's head, on its own at another turn, or
on any head at any turn. Moves are judged within a window of turns: by heads and tails a
little behind it (`windows_kernels`). What the window gained is kept if the whole
print does not end much later (simulated annealing, within windows and over them).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Int32s, Ints
from decmcts.compiled import apart, inlined, kernel
from decmcts.random_kernels import below, length_up_to, uniform
from decmcts.team.dec_mcts.windows_kernels import (
    GIVEN_UP,
    batch_of,
    begin_trial,
    copy_window,
    draw_windows,
    latest_end,
    undo,
    update_tails,
    with_lateness,
)
from decmcts.team.engine.joint_kernels import NONE, TeamState, Units, Visits, end_of
from decmcts.team.engine.replay_kernels import JointOrder, Marks, finish, place_turns, replay
from decmcts.team.engine.spaces_kernels import Fleet, travel_seconds

SHORTEST, LONGEST = 20, 400  # turns of a window
MARGIN = 20  # turns behind a move that are carried out to judge it
RUN = 30  # contours moved at once, at most
PROPOSALS = 60  # for each turn of a window
NEARBY = 0.7  # share of proposals that put a run beside a contour near one of its ends
STAYS = 0.05  # share that leave the run on its head, at another turn; the rest go to any head
BLIND = 0.1  # share tried whatever their travels
REVERSED = 0.1  # share of single contours that are entered at the end farther away


class Annealing(NamedTuple):
    """Which worse orders are taken, and where: the settings of simulated annealing."""

    temperature: float  # seconds, of a move
    slack: float  # seconds, the temperature of what a window as a whole does to the makespan
    lateness_weight: float  # weight of all heads' lateness beside that of the print
    shortest: int  # turns of a window, at least; all of an order that has fewer


class PolishMoves(NamedTuple):
    """What moves may draw from; the last two are scratch."""

    near: Int32s  # (2 n, k) contours near where contour c begins, 2 c, and ends
    eligible: Flags  # (n, heads)
    succ_offsets: Ints
    succs: Int32s
    run: Ints  # (RUN,) contours of the run
    trial: Ints  # (n,) contours by turn, as the move would have them


@inlined
def draw_run(
    c: int, end: int, joint: JointOrder, moves: PolishMoves, state: NDArray[np.uint64]
) -> int:
    """Write to `moves.run` a run of c's head from c on, before turn `end`; how long it is."""
    wanted = 1 if uniform(state) < 0.5 else length_up_to(state, RUN)
    count = 0
    while count < wanted and c != NONE and joint.turn[c] < end:
        moves.run[count] = c
        count += 1
        c = joint.behind[c]
    return count


@inlined
def seconds_between(
    r: int, c: int, c_back: bool, d: int, d_back: bool, visits: Visits, fleet: Fleet
) -> float:  # fmt: skip
    """Seconds of head r from the end of contour c to the begin of d; 0 if either is NONE."""
    if c == NONE or d == NONE:
        return 0.0
    p, q = end_of(c, 0 if c_back else 1, visits), end_of(d, 1 if d_back else 0, visits)
    return travel_seconds(p, q, fleet.travel[r])


@inlined
def travel_saved(
    count: int, joint: JointOrder, moves: PolishMoves, visits: Visits, fleet: Fleet
) -> float:
    """Seconds of travel that its head saves without the run."""
    first, last, back = moves.run[0], moves.run[count - 1], joint.reversed
    r, p, q = joint.head[first], joint.before[first], joint.behind[last]
    return (
        seconds_between(r, p, back[p], first, back[first], visits, fleet)
        + seconds_between(r, last, back[last], q, back[q], visits, fleet)
        - seconds_between(r, p, back[p], q, back[q], visits, fleet)
    )


@inlined
def travel_added(
    count: int, p: int, q: int, r: int, joint: JointOrder, moves: PolishMoves, visits: Visits,
    fleet: Fleet,
) -> tuple[float, bool]:  # fmt: skip
    """Return the seconds of travel the run costs head r, and whether a run of one is reversed."""
    first, last, back = moves.run[0], moves.run[count - 1], joint.reversed
    old = seconds_between(r, p, back[p], q, back[q], visits, fleet)
    is_reversed = back[first]
    new = seconds_between(r, p, back[p], first, is_reversed, visits, fleet)
    new += seconds_between(r, last, back[last], q, back[q], visits, fleet)
    if count == 1 and visits.reversible[first]:
        other = seconds_between(r, p, back[p], first, not is_reversed, visits, fleet)
        other += seconds_between(r, first, not is_reversed, q, back[q], visits, fleet)
        if other < new:
            return other - old, not is_reversed
    return new - old, is_reversed


@inlined
def in_run(c: int, count: int, joint: JointOrder, moves: PolishMoves) -> bool:
    """Whether contour c is one of the run."""
    first, last = moves.run[0], moves.run[count - 1]
    within = joint.turn[first] <= joint.turn[c] <= joint.turn[last]
    return bool(within and joint.head[c] == joint.head[first])


@inlined
def allowed_turns(
    low: int, high: int, count: int, joint: JointOrder, moves: PolishMoves, visits: Visits
) -> tuple[int, int]:
    """First and last turn of low..high before which precedence lets the run come."""
    for k in range(count):
        c = moves.run[k]
        for e in range(visits.pred_offsets[c], visits.pred_offsets[c + 1]):
            other = visits.preds[e]
            if joint.turn[other] >= low and not in_run(other, count, joint, moves):
                low = joint.turn[other] + 1
        for e in range(moves.succ_offsets[c], moves.succ_offsets[c + 1]):
            other = moves.succs[e]
            if joint.turn[other] < high and not in_run(other, count, joint, moves):
                high = joint.turn[other]
    return low, high


@inlined
def neighbours(
    turn: int, r: int, count: int, joint: JointOrder, moves: PolishMoves
) -> tuple[int, int]:
    """Return what head r prints before and from a turn on, without the run; NONE: nothing."""
    p, row = NONE, turn
    while row > 0 and p == NONE:
        row -= 1
        c = joint.order[row]
        if joint.head[c] == r and not in_run(c, count, joint, moves):
            p = c
    if p != NONE:
        q = joint.behind[p]
        return p, joint.behind[moves.run[count - 1]] if q == moves.run[0] else q
    for row in range(turn, len(joint.order)):
        c = joint.order[row]
        if joint.head[c] == r and not in_run(c, count, joint, moves):
            return NONE, c
    return NONE, NONE


@inlined
def rearrange(
    begin: int, end: int, count: int, goal: int, joint: JointOrder, moves: PolishMoves
) -> None:
    """Write turns begin..end - 1 to `moves.trial` with the run before turn `goal`."""
    row = begin
    for turn in range(begin, end + 1):
        if turn == goal:
            for k in range(count):
                moves.trial[row] = moves.run[k]
                row += 1
        if turn == end:
            break
        c = joint.order[turn]
        if not in_run(c, count, joint, moves):
            moves.trial[row] = c
            row += 1


@inlined
def estimate_delay(
    count: int, new: int, gain: float, cost: float, at: int, joint: JointOrder, moves: PolishMoves,
    visits: Visits, marks: Marks, annealing: Annealing,
) -> float:  # fmt: skip
    """Estimate how much later the print ends after a move, as if no head had to wait.

    `gain` and `cost` are the seconds of travel saved where the run was, and added where it goes.
    """
    old, lost, added = joint.head[moves.run[0]], gain, cost
    if old != new:
        for k in range(count):
            lost += visits.seconds[old, moves.run[k]]
            added += visits.seconds[new, moves.run[k]]
    latest, later = -np.inf, -np.inf
    for r in range(marks.free.shape[1]):
        end = marks.free[at, r] + marks.tail[at, r]
        latest = max(latest, end)
        if r == old:
            end -= lost
        if r == new:
            end += added
        later = max(later, end)
    outcome: float = later - latest + annealing.lateness_weight * (added - lost)
    return outcome


@inlined
def assign_run(
    count: int, r: int, is_reversed: bool, joint: JointOrder, moves: PolishMoves
) -> None:
    """Let head r print the run; a run of one is reversed as told (mutates joint)."""
    for k in range(count):
        joint.head[moves.run[k]] = r
    if count == 1:
        joint.reversed[moves.run[0]] = is_reversed


@apart
def evaluate_trial(
    begin: int, top: int, end: int, most: float, joint: JointOrder, moves: PolishMoves,
    visits: Visits, fleet: Fleet, units: Units, heads: TeamState, marks: Marks,
    annealing: Annealing,
) -> float:  # fmt: skip
    """Return by how much `moves.trial` makes the print later, judged at turn `end`.

    Infinite if it cannot be carried out, or as soon as it is more than `most` at a turn from
    `top` on. Its units are written behind those of the marks and left to be overwritten.
    """
    ended = np.empty(end - begin)
    for k in range(end - begin):
        ended[k] = heads.ended[moves.trial[begin + k]]
    begin_trial(begin, units, heads, marks)
    change = place_turns(
        moves.trial, begin, end, begin, top, most, joint, visits, fleet, units, heads, marks
    )
    change = with_lateness(change, annealing.lateness_weight, end, heads, marks)
    for k in range(end - begin):
        heads.ended[moves.trial[begin + k]] = ended[k]
    return change


@inlined
def relink(begin: int, top: int, r: int, joint: JointOrder) -> None:
    """Set what head r prints before and after its contours of turns begin..top - 1."""
    n = len(joint.order)
    turn = begin - 1
    while turn >= 0 and joint.head[joint.order[turn]] != r:
        turn -= 1
    last = joint.order[turn] if turn >= 0 else NONE
    for turn in range(begin, top):
        c = joint.order[turn]
        if joint.head[c] == r:
            joint.before[c] = last
            if last != NONE:
                joint.behind[last] = c
            last = c
    turn = top
    while turn < n and joint.head[joint.order[turn]] != r:
        turn += 1
    follower = joint.order[turn] if turn < n else NONE
    if last != NONE:
        joint.behind[last] = follower
    if follower != NONE:
        joint.before[follower] = last


@inlined
def draw_goal(
    low: int,
    high: int,
    count: int,
    joint: JointOrder,
    moves: PolishMoves,
    state: NDArray[np.uint64],
) -> tuple[int, int]:
    """Draw the turn before which the run is to come, and its head; NONE: no such turn."""
    first, last = moves.run[0], moves.run[count - 1]
    kind = uniform(state)
    if kind < NEARBY:
        port = 2 * (first if uniform(state) < 0.5 else last) + below(state, 2)
        d = moves.near[port, below(state, moves.near.shape[1])]
        goal = joint.turn[d] + below(state, 2)
        if not low <= goal <= high or in_run(d, count, joint, moves):
            return NONE, NONE
        return goal, joint.head[d]
    goal = low + below(state, high - low + 1)
    if kind < NEARBY + STAYS:
        return goal, joint.head[first]
    return goal, below(state, moves.eligible.shape[1])


@apart
def move_run(
    low: int, high: int, reach: int, joint: JointOrder, moves: PolishMoves, visits: Visits,
    fleet: Fleet, units: Units, heads: TeamState, marks: Marks, annealing: Annealing,
    state: NDArray[np.uint64],
) -> bool:  # fmt: skip
    """Propose one move within turns low..high - 1 and make it if accepted.

    False: the order with it cannot be carried out.
    """
    c = joint.order[low + below(state, high - low)]
    count = draw_run(c, high, joint, moves, state)
    first, last = moves.run[0], moves.run[count - 1]
    soonest, latest = allowed_turns(low, high, count, joint, moves, visits)
    if soonest > latest:
        return True
    goal, new = draw_goal(soonest, latest, count, joint, moves, state)
    if goal == NONE:
        return True
    old, before = joint.head[first], joint.reversed[first]
    if new != old:
        for k in range(count):
            if not moves.eligible[moves.run[k], new]:
                return True
    p, q = neighbours(goal, new, count, joint, moves)
    cost, is_reversed = travel_added(count, p, q, new, joint, moves, visits, fleet)
    if count == 1 and visits.reversible[first] and uniform(state) < REVERSED:
        is_reversed = not is_reversed
    alike = new == old and p == joint.before[first] and is_reversed == before
    if alike and (joint.turn[first] <= goal <= joint.turn[last] + 1 or uniform(state) > STAYS):
        return True  # nothing, or next to nothing, changes
    begin = min(joint.turn[first], goal)
    top = max(joint.turn[last] + 1, goal)
    end = min(reach, top + MARGIN)
    if marks.known[0] < end and not replay(end, joint, visits, fleet, units, heads, marks):
        return False
    limit = -np.log(uniform(state)) * annealing.temperature
    gain = travel_saved(count, joint, moves, visits, fleet)
    hopeless = (
        estimate_delay(count, new, gain, cost, end, joint, moves, visits, marks, annealing) > limit
    )
    if hopeless and uniform(state) > BLIND:
        return True
    rearrange(begin, end, count, goal, joint, moves)
    assign_run(count, new, is_reversed, joint, moves)
    most = limit + GIVEN_UP
    change = evaluate_trial(
        begin, top, end, most, joint, moves, visits, fleet, units, heads, marks, annealing
    )
    if change > limit:
        assign_run(count, old, before, joint, moves)
        return True
    for turn in range(begin, top):
        joint.order[turn] = moves.trial[turn]
        joint.turn[joint.order[turn]] = turn
    relink(begin, top, old, joint)
    if new != old:
        relink(begin, top, new, joint)
    marks.known[0] = begin
    return replay(end, joint, visits, fleet, units, heads, marks)


@inlined
def polish_window(
    low: int, high: int, annealing: Annealing, joint: JointOrder, moves: PolishMoves,
    visits: Visits, fleet: Fleet, units: Units, heads: TeamState, marks: Marks,
    state: NDArray[np.uint64],
) -> tuple[bool, float]:  # fmt: skip
    """Polish turns low..high - 1, judged at the end of turns a little behind.

    Returns False if the order cannot be carried out, and how much later the print may end
    for it; what makes it later than that is undone.
    """
    reach = min(len(joint.order), high + MARGIN)
    if not replay(reach, joint, visits, fleet, units, heads, marks):
        return False, 0.0
    before = latest_end(reach, fleet, marks)
    kept, there = copy_window(low, high, joint), True
    for _ in range(PROPOSALS * (high - low)):
        there = there and move_run(
            low, high, reach, joint, moves, visits, fleet, units, heads, marks, annealing, state
        )
    allowed = -annealing.slack * np.log(uniform(state))
    there = there and replay(reach, joint, visits, fleet, units, heads, marks)
    if not there or latest_end(reach, fleet, marks) > before + allowed:
        undo(low, kept, joint, marks)
        return True, 0.0
    return True, allowed


@kernel
def polish(
    makespan: float, windows: int, annealing: Annealing, moves: PolishMoves, joint: JointOrder,
    visits: Visits, fleet: Fleet, units: Units, heads: TeamState, marks: Marks,
    state: NDArray[np.uint64],
) -> float:  # fmt: skip
    """Polish `windows` random windows (mutates all but visits, fleet); return the makespan.

    `makespan` is that of the order now. What makes it much later is undone.
    """
    n, left = len(joint.order), windows
    while left > 0:
        if not update_tails(joint, visits, fleet, units, heads, marks):
            return np.inf
        count = batch_of(n, left)
        left -= count
        drawn = draw_windows(count, n, SHORTEST, LONGEST, annealing.shortest, state)
        first = int(drawn[:, 0].min())
        kept, allowed, there = copy_window(first, n, joint), 0.0, True
        for k in range(count):
            if there:
                there, more = polish_window(
                    drawn[k, 0], drawn[k, 1], annealing, joint, moves, visits, fleet, units, heads,
                    marks, state,
                )  # fmt: skip
                allowed += more
        found = np.inf
        if there:
            found = finish(marks.known[0], joint, visits, fleet, units, heads, marks)
        if found < np.inf and found <= makespan + allowed:
            makespan = found
        else:
            undo(first, kept, joint, marks)
    return makespan
