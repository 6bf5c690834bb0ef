"""Local search on one order of everything that several heads do, on bare arrays.

A move takes a run of contours that one head prints one after the other and puts it
before or behind another contour: on that contour's head, or on its own head at another
turn. Moves are judged within a window of turns: by when the heads are free a little
behind it. What the window gained is kept if the whole print does not end much later
(simulated annealing, within windows and over them).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.aside import print_next
from decmcts._kernels.jit import inlined, kernel
from decmcts._kernels.joint import NONE, Heads, Units, Visits, end_of
from decmcts._kernels.random import below, length_up_to, uniform
from decmcts._kernels.replay import JointOrder, Marks, finish, has_room, link, recall, replay
from decmcts._kernels.rooms import Fleet, travel_seconds

SHORTEST, LONGEST = 20, 400  # turns of a window
MARGIN = 40  # turns behind a move that are carried out to judge it
RUN = 30  # contours moved at once, at most
PROPOSALS = 60  # for each turn of a window
TEMPERATURE = 0.003  # seconds, of a move
SLACK = 0.3  # seconds, of what a window does to the makespan
NEARBY = 0.6  # share of proposals that put a run beside a contour near one of its ends
STAYS = 0.02  # share that leave the run on its head, at another turn
BLIND = 0.1  # share tried whatever their travels


class Moves(NamedTuple):
    """What moves there are, and room to try them; the last two are scratch."""

    near: NDArray[np.int32]  # (2 n, k) contours near where contour c begins, 2 c, and ends
    eligible: NDArray[np.bool_]  # (n, heads)
    succ_offsets: NDArray[np.int64]
    succs: NDArray[np.int32]
    run: NDArray[np.int64]  # (RUN,) contours of the run
    trial: NDArray[np.int64]  # (LONGEST + MARGIN,) contours, as the move would have them


@inlined
def gather(c: int, end: int, joint: JointOrder, moves: Moves, state: NDArray[np.uint64]) -> int:
    """Write to `moves.run` a run of c's head from c on, before turn `end`; how long it is."""
    wanted = 1 if uniform(state) < 0.5 else length_up_to(state, RUN)
    count = 0
    while count < wanted and c != NONE and joint.turn[c] < end:
        moves.run[count] = c
        count += 1
        c = joint.behind[c]
    return count


@inlined
def way(
    r: int, c: int, c_back: bool, d: int, d_back: bool, visits: Visits, fleet: Fleet
) -> float:  # fmt: skip
    """Seconds of head r from the end of contour c to the begin of d; 0 if either is NONE."""
    if c == NONE or d == NONE:
        return 0.0
    p, q = end_of(c, 0 if c_back else 1, visits), end_of(d, 1 if d_back else 0, visits)
    return travel_seconds(p, q, fleet.travel[r])


@inlined
def saved(count: int, joint: JointOrder, moves: Moves, visits: Visits, fleet: Fleet) -> float:
    """Seconds of travel that its head saves without the run."""
    first, last, back = moves.run[0], moves.run[count - 1], joint.backwards
    r, p, q = joint.head[first], joint.before[first], joint.behind[last]
    return (
        way(r, p, back[p], first, back[first], visits, fleet)
        + way(r, last, back[last], q, back[q], visits, fleet)
        - way(r, p, back[p], q, back[q], visits, fleet)
    )


@inlined
def spent(
    count: int, d: int, behind: bool, joint: JointOrder, moves: Moves, visits: Visits, fleet: Fleet
) -> tuple[float, bool]:
    """Seconds of travel the run costs beside d, and whether a run of one is turned round."""
    first, last, back = moves.run[0], moves.run[count - 1], joint.backwards
    r = joint.head[d]
    p, q = (d, joint.behind[d]) if behind else (joint.before[d], d)
    if p == last:
        p = joint.before[first]
    if q == first:
        q = joint.behind[last]
    old = way(r, p, back[p], q, back[q], visits, fleet)
    turned = back[first]
    new = way(r, p, back[p], first, turned, visits, fleet)
    new += way(r, last, back[last], q, back[q], visits, fleet)
    if count == 1 and visits.reversible[first]:
        other = way(r, p, back[p], first, not turned, visits, fleet)
        other += way(r, first, not turned, q, back[q], visits, fleet)
        if other < new:
            return other - old, not turned
    return new - old, turned


@inlined
def in_run(c: int, count: int, joint: JointOrder, moves: Moves) -> bool:
    """Whether contour c is one of the run."""
    first, last = moves.run[0], moves.run[count - 1]
    within = joint.turn[first] <= joint.turn[c] <= joint.turn[last]
    return bool(within and joint.head[c] == joint.head[first])


@inlined
def keeps_precedence(
    count: int, d: int, behind: bool, joint: JointOrder, moves: Moves, visits: Visits
) -> bool:
    """Whether beside d the run comes after what it rests on and before what rests on it."""
    last = joint.turn[d] if behind else joint.turn[d] - 1  # turn the run comes behind
    for k in range(count):
        c = moves.run[k]
        if last < joint.turn[c]:
            for e in range(visits.pred_offsets[c], visits.pred_offsets[c + 1]):
                other = visits.preds[e]
                if joint.turn[other] > last and not in_run(other, count, joint, moves):
                    return False
        else:
            for e in range(moves.succ_offsets[c], moves.succ_offsets[c + 1]):
                other = moves.succs[e]
                if joint.turn[other] <= last and not in_run(other, count, joint, moves):
                    return False
    return True


@inlined
def rearrange(
    begin: int, end: int, count: int, d: int, behind: bool, joint: JointOrder, moves: Moves
) -> None:
    """Write turns begin..end - 1 as the move has them to `moves.trial`."""
    row = 0
    for turn in range(begin, end):
        c = joint.order[turn]
        if c == d and behind:
            moves.trial[row] = c
            row += 1
        if c == d:
            for k in range(count):
                moves.trial[row] = moves.run[k]
                row += 1
        if not (c == d and behind) and not in_run(c, count, joint, moves):
            moves.trial[row] = c
            row += 1


@inlined
def lateness(free: NDArray[np.float64], usual: NDArray[np.float64]) -> float:
    """How late heads are: all together, and the latest once more."""
    total, most = 0.0, -np.inf
    for r in range(len(free)):
        total += free[r] - usual[r]
        most = max(most, free[r] - usual[r])
    return total + most


@inlined
def hand_over(count: int, r: int, turned: bool, joint: JointOrder, moves: Moves) -> None:
    """Let head r print the run; a run of one is turned round as told (mutates joint)."""
    for k in range(count):
        joint.head[moves.run[k]] = r
    if count == 1:
        joint.backwards[moves.run[0]] = turned


@kernel
def try_out(
    begin: int, end: int, joint: JointOrder, moves: Moves, visits: Visits, fleet: Fleet,
    units: Units, heads: Heads, marks: Marks, usual: NDArray[np.float64],
) -> float:  # fmt: skip
    """Return by how much `moves.trial` makes heads later at turn `end`; inf: there is no room.

    Its units are written behind those of the marks and left to be overwritten.
    """
    ended = np.empty(end - begin)
    for k in range(end - begin):
        ended[k] = heads.ended[moves.trial[k]]
    recall(begin, units, heads, marks)
    units.used[0] = marks.used[marks.known[0]]
    change = -lateness(marks.free[end], usual)
    for k in range(end - begin):
        c = moves.trial[k]
        back = joint.backwards[c]
        if not has_room(units, heads) or not print_next(
            joint.head[c], c, back, visits, fleet, units, heads
        ):
            change = np.inf
            break
    change += lateness(heads.free, usual)
    for k in range(end - begin):
        heads.ended[moves.trial[k]] = ended[k]
    return change


@inlined
def relink(begin: int, top: int, r: int, joint: JointOrder) -> None:
    """Find again what head r prints before and after its contours of turns begin..top - 1."""
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
def move_run(
    low: int, high: int, reach: int, joint: JointOrder, moves: Moves, visits: Visits,
    fleet: Fleet, units: Units, heads: Heads, marks: Marks, usual: NDArray[np.float64],
    state: NDArray[np.uint64],
) -> bool:  # fmt: skip
    """Propose one move within turns low..high - 1 and make it if it is good; False: no room."""
    c = joint.order[low + below(state, high - low)]
    count = gather(c, high, joint, moves, state)
    first, last = moves.run[0], moves.run[count - 1]
    d: int = joint.order[low + below(state, high - low)]
    if uniform(state) < NEARBY:
        port = 2 * (first if uniform(state) < 0.5 else last) + below(state, 2)
        d = moves.near[port, below(state, moves.near.shape[1])]
    if not low <= joint.turn[d] < high:
        return True
    for k in range(count):
        if moves.run[k] == d:
            return True
    behind, stays = uniform(state) < 0.5, uniform(state) < STAYS
    limit = -np.log(uniform(state)) * TEMPERATURE
    old, new, turned = joint.head[c], joint.head[c], joint.backwards[c]
    if not stays:
        new = joint.head[d]
        for k in range(count):
            if not moves.eligible[moves.run[k], new]:
                return True
        cost, turned = spent(count, d, behind, joint, moves, visits, fleet)
        cost -= saved(count, joint, moves, visits, fleet)
        if turned == joint.backwards[c] and d == (
            joint.before[first] if behind else joint.behind[last]
        ):
            return True
        if cost > limit and uniform(state) > BLIND:
            return True
    if not keeps_precedence(count, d, behind, joint, moves, visits):
        return True
    begin = min(joint.turn[first], joint.turn[d])
    top = max(joint.turn[last], joint.turn[d]) + 1
    end = min(reach, top + MARGIN)
    if marks.known[0] < end and not replay(end, joint, visits, fleet, units, heads, marks):
        return False
    rearrange(begin, end, count, d, behind, joint, moves)
    before = joint.backwards[c]
    hand_over(count, new, turned, joint, moves)
    change = try_out(begin, end, joint, moves, visits, fleet, units, heads, marks, usual[end - low])
    if change > limit:
        hand_over(count, old, before, joint, moves)
        return True
    for turn in range(begin, top):
        joint.order[turn] = moves.trial[turn - begin]
        joint.turn[joint.order[turn]] = turn
    relink(begin, top, old, joint)
    if new != old:
        relink(begin, top, new, joint)
    marks.known[0] = begin
    return replay(end, joint, visits, fleet, units, heads, marks)


@kernel
def polish(
    makespan: float, windows: int, joint: JointOrder, moves: Moves, visits: Visits,
    fleet: Fleet, units: Units, heads: Heads, marks: Marks, state: NDArray[np.uint64],
) -> float:  # fmt: skip
    """Polish `windows` random windows (mutates all but visits, fleet); return the makespan.

    `makespan` is that of the order now. What makes it much later is undone.
    """
    n = len(joint.order)
    for _ in range(windows):
        share = uniform(state)
        width = min(n, int(SHORTEST * (LONGEST / SHORTEST) ** share))
        low = min(max(0, below(state, n + width) - width), n - width)
        high = low + width
        reach = min(n, high + MARGIN)
        if not replay(reach, joint, visits, fleet, units, heads, marks):
            return np.inf
        usual = marks.free[low : reach + 1].copy()
        order = joint.order[low:high].copy()
        head, backwards = joint.head[order], joint.backwards[order]
        there = True
        for _ in range(PROPOSALS * width):
            there = there and move_run(
                low, high, reach, joint, moves, visits, fleet, units, heads, marks, usual, state
            )
        found = np.inf
        if there and replay(reach, joint, visits, fleet, units, heads, marks):
            found = finish(reach, joint, visits, fleet, units, heads, marks)
        if found <= makespan - SLACK * np.log(uniform(state)):
            makespan = found
            continue
        for k in range(width):
            c = order[k]
            joint.order[low + k], joint.head[c], joint.backwards[c] = c, head[k], backwards[k]
        link(joint, len(fleet.parks))
        marks.known[0] = min(marks.known[0], low)
    return makespan
