"""Heads at rest on the path of another: where they step aside to, on bare arrays.

Machines differ: on one rail there is always space outwards as long as what lies
beyond can be pushed on; heads over one plane may shut each other in. So a state
(where every head rests) counts as *safe* only if the heads can return to their
parks one after the other, and units are placed only if the state after them is
safe. From a safe state all heads can be parked; from there a contour can be
printed by each head for which `path_from_parks` finds a path, and after that the
state is safe again. So nothing ever gets stuck: this is the banker's algorithm
(Dijkstra 1965, EWD 123) with space in place of money.
"""

from __future__ import annotations

import numpy as np

from decmcts.arrays import Flags, Floats
from decmcts.compiled import apart, inlined, kernel
from decmcts.team.engine.joint_kernels import (
    UNIT_ASIDE,
    UNIT_PARK,
    TeamState,
    Units,
    Visits,
    end_of,
    place_print,
    place_travel,
)
from decmcts.team.engine.spaces_kernels import (
    TOUCH,
    Fleet,
    Space,
    join_spaces,
    keep_space,
    space_at,
    space_of_point,
    space_of_travel,
    too_near,
)


@kernel
def clear_position(
    space: Space,
    rest: Space,
    r: int,
    s: int,
    axis: int,
    sign: int,
    fleet: Fleet,
) -> float:
    """Where along an axis head s, now in `rest`, is clear of head r anywhere in `space`."""
    pair = r * len(fleet.parks) + s
    goal: float = rest[2 * axis]
    for k in range(fleet.relation_offsets[pair], fleet.relation_offsets[pair + 1]):
        box = fleet.relation[k]
        other, beside = 1 - axis, True
        for a in (other, 2):
            low, high = rest[2 * a] - space[2 * a + 1], rest[2 * a + 1] - space[2 * a]
            if low >= box[2 * a + 1] - TOUCH or high <= box[2 * a] + TOUCH:
                beside = False
        if beside and sign > 0:
            goal = max(goal, space[2 * axis + 1] + box[2 * axis + 1])
        elif beside:
            goal = min(goal, space[2 * axis] + box[2 * axis])
    return goal


@kernel
def push(
    space: Space,
    r: int,
    s: int,
    axis: int,
    sign: int,
    at: Floats,
    rest: Floats,
    fleet: Fleet,
    goals: Floats,
    goes: Flags,
) -> bool:
    """Write to `goals` and `goes` where s must go, and all it pushes on; False: too far."""
    heads = len(at)
    goals[:], goes[:] = at, False
    goals[s, axis] = clear_position(space, space_at(rest, s), r, s, axis, sign, fleet)
    goes[s] = True
    for _ in range(heads):
        for u in range(heads):
            if not goes[u]:
                continue
            path = space_of_travel(at[u], goals[u], fleet.ceiling)
            for t in range(heads):
                if t in (u, r):
                    continue
                resting = space_at(rest, t)
                far = clear_position(path, resting, u, t, axis, sign, fleet)
                if too_near(path, resting, u, t, fleet) and (far - goals[t, axis]) * sign > TOUCH:
                    goals[t, axis], goes[t] = far, True
    for t in range(heads):
        x = goals[t, axis]
        if goes[t] and not fleet.low[t, axis] - TOUCH <= x <= fleet.high[t, axis] + TOUCH:
            return False
    return True


@kernel
def next_to_go(axis: int, sign: int, at: Floats, goes: Flags) -> int:
    """Of the heads that go, the one farthest along; -1: none is left."""
    found = -1
    for t in range(len(goes)):
        if goes[t] and (found < 0 or (at[t, axis] - at[found, axis]) * sign > 0.0):
            found = t
    return found


@kernel
def try_push(
    space: Space,
    r: int,
    axis: int,
    sign: int,
    goals: Floats,
    goes: Flags,
    at: Floats,
    rest: Floats,
    fleet: Fleet,
    steps: Floats,
) -> int:
    """Move the heads that go, the farthest first (mutates at, rest, goes); how many, -1: no path.

    `steps` (heads, 4) gets who goes where: head, x, y, z.
    """
    moved = 0
    while True:
        t = next_to_go(axis, sign, at, goes)
        if t < 0:
            return moved
        goes[t] = False
        path = space_of_travel(at[t], goals[t], fleet.ceiling)
        for u in range(len(at)):
            if u != t and too_near(path, space_at(rest, u), t, u, fleet):
                return -1
        at[t] = goals[t]
        keep_space(space_of_point(at[t], fleet.ceiling), rest, t)
        if too_near(space, space_at(rest, t), r, t, fleet):
            return -1
        steps[moved, 0] = t
        steps[moved, 1:] = at[t]
        moved += 1


@kernel
def find_steps_aside(
    space: Space,
    r: int,
    at: Floats,
    rest: Floats,
    fleet: Fleet,
    steps: Floats,
) -> int:
    """Move heads aside until `space` of head r is clear (mutates at, rest); how many, -1: no path.

    `steps` (heads * heads, 4) gets who goes where, one after the other. Of the
    directions along x and y each takes the one with the shortest paths of all.
    """
    heads, count = len(at), 0
    goals, goes = np.empty((heads, 3)), np.empty(heads, np.bool_)
    best_at, best_rest = np.empty((heads, 3)), np.empty((heads, 6))
    tried, best_steps = np.empty((heads, 4)), np.empty((heads, 4))
    for s in range(heads):
        if s == r or not too_near(space, space_at(rest, s), r, s, fleet):
            continue
        least, best = np.inf, -1
        for axis in range(2):
            for sign in (-1, 1):
                if not push(space, r, s, axis, sign, at, rest, fleet, goals, goes):
                    continue
                length = np.abs(goals - at).sum()
                if length >= least:
                    continue
                there, resting = at.copy(), rest.copy()
                moved = try_push(space, r, axis, sign, goals, goes, there, resting, fleet, tried)
                if moved > 0:
                    least, best = length, moved
                    best_at[:], best_rest[:], best_steps[:] = there, resting, tried
        if best < 0:
            return -1
        at[:], rest[:] = best_at, best_rest
        steps[count : count + best] = best_steps[:best]
        count += best
    return count


@kernel
def next_home(at: Floats, rest: Floats, fleet: Fleet) -> int:
    """Return a head whose path to its park is clear; -1: none, or all are there."""
    for t in range(len(at)):
        if np.all(at[t] == fleet.parks[t]):
            continue
        path = space_of_travel(at[t], fleet.parks[t], fleet.ceiling)
        clear = True
        for u in range(len(at)):
            if u != t and too_near(path, space_at(rest, u), t, u, fleet):
                clear = False
                break
        if clear:
            return t
    return -1


@kernel
def is_safe(at: Floats, rest: Floats, fleet: Fleet) -> bool:
    """Whether the heads can return to their parks one after the other."""
    if fleet.lined:
        return True
    there, resting = at.copy(), rest.copy()
    while True:
        t = next_home(there, resting, fleet)
        if t < 0:
            return bool(np.all(there == fleet.parks))
        there[t] = fleet.parks[t]
        keep_space(space_of_point(there[t], -np.inf), resting, t)


@apart
def return_all(visits: Visits, fleet: Fleet, units: Units, heads: TeamState) -> bool:
    """Send every head to its park, one after the other (mutates); False: some are shut in."""
    while True:
        t = next_home(heads.at, heads.rest, fleet)
        if t < 0:
            return bool(np.all(heads.at == fleet.parks))
        place_travel(t, UNIT_PARK, fleet.parks[t], visits, fleet, units, heads)


@inlined
def space_for(r: int, c: int, is_reversed: bool, at: Floats, visits: Visits, fleet: Fleet) -> Space:
    """Space that head r reserves to go from where it stands, `at` (heads, 3), and print c."""
    side = 1 if is_reversed else 0
    path = space_of_travel((at[r, 0], at[r, 1], at[r, 2]), end_of(c, side, visits), fleet.ceiling)
    return join_spaces(path, space_at(visits.pieces.space, visits.pieces.offsets[2 * c + side]))


@kernel
def path_from_parks(r: int, c: int, visits: Visits, fleet: Fleet) -> bool:
    """Whether head r can print contour c while the others are parked or step aside, safely."""
    heads = len(fleet.parks)
    at, rest = fleet.parks.copy(), np.empty((heads, 6))
    for t in range(heads):
        keep_space(space_of_point(at[t], -np.inf), rest, t)
    space = space_for(r, c, False, at, visits, fleet)
    if find_steps_aside(space, r, at, rest, fleet, np.empty((heads * heads, 4))) < 0:
        return False
    for end in range(2):
        at[r] = visits.ends[c, end]
        keep_space(space_of_point(at[r], -np.inf), rest, r)
        if not is_safe(at, rest, fleet):
            return False
    return True


@inlined
def is_in_way(r: int, space: Space, rest: Floats, fleet: Fleet) -> bool:
    """Whether some other head rests where head r needs `space`."""
    for s in range(len(rest)):
        if s != r and too_near(space, space_at(rest, s), r, s, fleet):
            return True
    return False


@kernel
def step_aside(
    r: int, c: int, is_reversed: bool, visits: Visits, fleet: Fleet, units: Units, heads: TeamState
) -> bool:
    """Let heads step aside so that r can print c (mutates units, heads); False: no safe path."""
    space = space_for(r, c, is_reversed, heads.at, visits, fleet)
    at, rest = heads.at.copy(), heads.rest.copy()
    steps = np.empty((len(at) * len(at), 4))
    count = find_steps_aside(space, r, at, rest, fleet, steps)
    if count < 0:
        return False
    if not fleet.lined:
        at[r] = visits.ends[c, 0 if is_reversed else 1]
        keep_space(space_of_point(at[r], -np.inf), rest, r)
        if not is_safe(at, rest, fleet):
            return False
    for k in range(count):
        place_travel(int(steps[k, 0]), UNIT_ASIDE, steps[k, 1:], visits, fleet, units, heads)
    return True


@inlined
def print_next(
    r: int, c: int, is_reversed: bool, visits: Visits, fleet: Fleet, units: Units, heads: TeamState
) -> bool:
    """Let head r print c, whatever has to step aside or return first (mutates units, heads).

    False: not even with all others parked. All that supports c must have been placed.
    """
    space = space_for(r, c, is_reversed, heads.at, visits, fleet)
    possible = (fleet.lined and not is_in_way(r, space, heads.rest, fleet)) or step_aside_or_park(
        r, c, is_reversed, visits, fleet, units, heads
    )
    if possible:
        place_print(r, c, is_reversed, visits, fleet, units, heads)
    return possible


@apart
def step_aside_or_park(
    r: int, c: int, is_reversed: bool, visits: Visits, fleet: Fleet, units: Units, heads: TeamState
) -> bool:
    """Let others step aside, or all return first, so that r can print c (mutates units, heads)."""
    if step_aside(r, c, is_reversed, visits, fleet, units, heads):
        return True
    if not return_all(visits, fleet, units, heads):
        return False
    return step_aside(r, c, is_reversed, visits, fleet, units, heads)
