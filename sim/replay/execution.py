"""Replays of a joint plan in time: nominal, random and adversarial timing.

The exact check of `sim.verify` already covers every timing; the replay moves
the heads through some of them, with other logic, and counts what happens.
Within a segment the speed is taken as uniform: the timing error tried here is
far larger than that. Actions that others wait for midway are replayed leg by leg
(`sim.content.paths`), and a lag counts from when its point was passed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, combinations, product

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.print.machine import Machine
from decmcts.print.plan import HeadActions, PlanDocument
from sim.content.paths import Legs
from sim.faults import LIMIT, Fault, FaultKind, listed
from sim.replay.bodies import TOLERANCE_MM
from sim.replay.compiled import compiled
from sim.replay.shapes import (
    Solid,
    bounds_of,
    parts_of,
    separations_between,
    swept_vertices,
)
from sim.rules.order import PartialOrder

SLOWEST, FASTEST = 2.0, 0.5  # an action takes up to so many times its planned time, or so few


@dataclass(frozen=True, slots=True)
class TimedPath:
    """Where one head is over time, piecewise straight; rests have two equal points."""

    time: Floats  # (k,) non-decreasing seconds
    point: Floats  # (k, 3)
    action: Ints  # (k,) leg the piece that begins here belongs to; -1 before the first


def check_replays(
    document: PlanDocument, legs: Legs, order: PartialOrder, arrivals: list[Floats],
    counts: dict[str, float], trials: int, seed: int,
) -> list[Fault]:  # fmt: skip
    """Move the heads through nominal, random and adversarial timings; adds to `counts`."""
    machine, contacts, breaks = document.machine, list[str](), list[str]()
    passing = [legs.arrivals(h, times) for h, times in enumerate(arrivals)]
    for name, factors in timing_factors(legs, trials, seed):
        courses = run_trial(machine, legs.all_actions, order, passing, factors)
        for pieces in shared_pieces(courses):
            contacts += [_met(legs, name, pieces, *m) for m in head_conflicts(machine, pieces)]
            breaks += [_met(legs, name, pieces, *m) for m in rail_breaks(machine, pieces)]
        counts["replays"] = counts.get("replays", 0) + 1
    counts["contacts"] = len(contacts)
    return [*listed(FaultKind.HEAD_HEAD, contacts), *listed(FaultKind.RAIL, breaks)]


def _met(legs: Legs, trial: str, pieces: PairMotion, k: int, gap: float, turn: int = 1) -> str:
    """Say how near two heads are in a piece of their motion, the second first with turn -1."""
    (r, s), (a, b) = pieces.heads[::turn], pieces.actions[k, ::turn].tolist()
    return (
        f"replay {trial!r} at {pieces.time[k]:.2f} s: {legs.station(r, a)} and "
        f"{legs.station(s, b)}: {gap:.3f} mm apart"
    )


def timing_factors(legs: Legs, trials: int, seed: int) -> Iterator[tuple[str, list[Floats]]]:
    """Yield named timing errors, one factor a leg.

    Nominal; every action at random between half and twice its time; one head
    all fast and the others all slow, for each head; and fast and slow in turn.
    Where actions are cut, the same at random and in turn for their legs.
    """
    yield "nominal", [np.ones(len(actions)) for actions in legs.all_actions]
    sizes, several = [len(actions) for actions in legs.whole], len(legs.whole) > 1
    for name, factors in chain(_random(sizes, trials, seed), _biased(legs) if several else ()):
        of_legs = zip(factors, legs.origin, strict=True)
        yield name, [factor[origin] for factor, origin in of_legs]
    if several and legs.cut:
        sizes = [len(actions) for actions in legs.all_actions]
        for name, factors in chain(_random(sizes, trials, seed), _in_turn(sizes)):
            yield f"{name}, each leg", factors


def _random(sizes: list[int], trials: int, seed: int) -> Iterator[tuple[str, list[Floats]]]:
    for trial in range(trials):
        rng = np.random.default_rng([seed, trial])
        yield f"random {trial}", [np.exp2(rng.uniform(-1.0, 1.0, n)) for n in sizes]


def _biased(legs: Legs) -> Iterator[tuple[str, list[Floats]]]:
    sizes = [len(actions) for actions in legs.whole]
    for h, actions in enumerate(legs.whole):
        speeds = [FASTEST if r == h else SLOWEST for r in range(len(sizes))]
        yield f"head {actions.head} fast", list(map(np.full, sizes, speeds))
    yield from _in_turn(sizes)


def _in_turn(sizes: list[int]) -> Iterator[tuple[str, list[Floats]]]:
    for first in range(2):
        turns = [(np.arange(n) + r + first) % 2 for r, n in enumerate(sizes)]
        yield f"in turn {first}", [np.where(turn, SLOWEST, FASTEST) for turn in turns]


def execute(
    all_actions: tuple[HeadActions, ...], order: PartialOrder, seconds: list[Floats]
) -> list[Floats]:
    """Return when each leg begins if each begins as early as order and lags allow."""
    start = np.cumsum([0, *map(len, all_actions)]).astype(np.int64)
    number = start[order.sequence[:, 0]] + order.sequence[:, 1]
    first = order.sequence[:, 1] == 0
    counts = np.concatenate([np.diff(actions.after_offsets) for actions in all_actions])
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    after = [start[actions.after_head] + actions.after_action for actions in all_actions]
    lags = np.concatenate([actions.after_lag_s for actions in all_actions])
    taken = np.concatenate(seconds)
    begin = _earliest(number, first, offsets, np.concatenate(after), lags, taken)
    return [begin[start[r] : start[r + 1]] for r in range(len(all_actions))]


@compiled
def _earliest(
    number: Ints, first: Ints, offsets: Ints, after: Ints, lags: Floats, seconds: Floats
) -> Floats:
    begin = np.zeros(len(seconds))
    for k in range(len(number)):
        a = number[k]
        if not first[k]:
            begin[a] = begin[a - 1] + seconds[a - 1]
        for row in range(offsets[a], offsets[a + 1]):
            begin[a] = max(begin[a], begin[after[row]] + seconds[after[row]] + lags[row])
    return begin


def head_conflicts(machine: Machine, pieces: PairMotion) -> list[tuple[int, float]]:
    """Return the pieces in which two heads come nearer than the clearance, and how near.

    The first piece found of each pair of legs, `LIMIT` at most.
    """
    reach = machine.head_clearance_mm - TOLERANCE_MM
    mine, theirs = ([part.vertices() for part in parts_of(machine.heads[h])] for h in pieces.heads)
    if not mine or not theirs:
        return []
    every = np.arange(len(pieces.time) - 1)
    near = _near_pieces(
        pieces, every, bounds_of(np.concatenate(mine)), bounds_of(np.concatenate(theirs)), reach
    )
    found: dict[tuple[int, int], tuple[int, float]] = {}
    bounded = ([(part, bounds_of(part)) for part in parts] for parts in (mine, theirs))
    for (a, bounds), (b, other_bounds) in product(*bounded):
        for k in _near_pieces(pieces, near, bounds, other_bounds, reach).tolist():
            actions = (int(pieces.actions[k, 0]), int(pieces.actions[k, 1]))
            if actions in found or len(found) >= LIMIT:
                continue
            # both move straight and evenly, so the second as seen from the first does too
            moved = pieces.a[k + 1] - pieces.a[k]
            swept = swept_vertices(b, pieces.b[k], pieces.b[k + 1] - moved)
            gap = Solid(a + pieces.a[k]).distance(Solid(swept))
            if gap < reach:
                found[actions] = k, gap
    return list(found.values())


@dataclass(frozen=True, slots=True)
class PairMotion:
    """Two heads on one time axis; between two times each moves straight."""

    heads: tuple[int, int]
    time: Floats  # (k,)
    a: Floats  # (k, 3)
    b: Floats  # (k, 3)
    actions: Ints  # (k, 2)


def shared_pieces(courses: list[TimedPath]) -> list[PairMotion]:
    """Return each pair of heads, the lower first, on one time axis."""
    found = []
    for heads in combinations(range(len(courses)), 2):
        both = [courses[h] for h in heads]
        time = np.sort(np.concatenate([course.time for course in both]), kind="stable")  # two runs
        time = time[np.concatenate([[True], time[1:] != time[:-1]])]
        points, actions = np.empty((2, len(time), 3)), np.empty((len(time), 2), np.int64)
        for n, course in enumerate(both):
            _follow(time, course.time, course.point, course.action, points[n], actions[:, n])
        found.append(PairMotion(heads, time, points[0], points[1], actions))
    return found


@compiled
def _follow(
    time: Floats, at: Floats, point: Floats, action: Ints, points: Floats, actions: Ints
) -> None:
    """Write where a course is at each time, and of what the piece that begins then is."""
    last, j = len(at) - 1, 0
    for k in range(len(time)):
        while j < last and at[j + 1] <= time[k]:
            j += 1
        for d in range(3):
            points[k, d] = point[j, d]
            if j < last and at[j] != time[k]:
                slope = (point[j + 1, d] - point[j, d]) / (at[j + 1] - at[j])
                points[k, d] = slope * (time[k] - at[j]) + point[j, d]
        middle = (time[min(k + 1, len(time) - 1)] + time[k]) / 2
        i = j
        while i < last and at[i + 1] <= middle:
            i += 1
        actions[k] = action[i]


def _near_pieces(
    pieces: PairMotion, rows: Ints, a_box: Floats, b_box: Floats, reach: float
) -> Ints:
    """Return those of `rows` in which the swept bounding boxes come nearer than `reach`."""
    limits = np.stack([b_box[1] - a_box[0] + reach, a_box[1] - b_box[0] + reach])
    return rows[_near(pieces.a, pieces.b, rows, limits)]


@compiled
def _near(a: Floats, b: Floats, rows: Ints, limits: Floats) -> Flags:
    """Tell of each row whether each tip stays below the other by less than its limit, mm, (2, 3).

    Least of the first less most of the second, and the other way round, axis by axis.
    """
    near = np.ones(len(rows), np.bool_)
    for n in range(len(rows)):
        k = rows[n]
        for d in range(3):
            below = min(a[k, d], a[k + 1, d]) - max(b[k, d], b[k + 1, d])
            above = min(b[k, d], b[k + 1, d]) - max(a[k, d], a[k + 1, d])
            if not (below < limits[0, d] and above < limits[1, d]):
                near[n] = False
                break
    return near


def rail_breaks(machine: Machine, pieces: PairMotion) -> list[tuple[int, float, int]]:
    """Return the first piece in which two heads break each rail they share, and how near they are.

    Last -1 where the second head comes first along the rail, else 1.
    """
    found = []
    first, second = (machine.heads[h] for h in pieces.heads)
    for axis, side, least in separations_between(machine, first, second):
        gap = side * (pieces.b - pieces.a)[:, axis]
        bad = np.flatnonzero(gap < least - TOLERANCE_MM)
        if len(bad):
            found.append((int(bad[0]), float(gap[bad[0]]), int(side)))
    return found


def run_trial(
    machine: Machine,
    all_actions: tuple[HeadActions, ...],
    order: PartialOrder,
    arrivals: list[Floats],
    factors: list[Floats],
) -> list[TimedPath]:
    """Return where all heads are if the plan is executed with one timing error."""
    seconds = [
        factor * times[actions.path_offsets[1:] - 1]
        for actions, factor, times in zip(all_actions, factors, arrivals, strict=True)
    ]
    begin = execute(all_actions, order, seconds)
    ends = (b + d for b, d in zip(begin, seconds, strict=True))
    end_s = max(float(each.max(initial=0.0)) for each in ends)
    found = []
    for h, actions in enumerate(all_actions):
        owner = np.repeat(np.arange(len(actions)), np.diff(actions.path_offsets))
        path = actions.path if len(actions) else np.array([machine.heads[h].park], np.float64)
        times = begin[h][owner] + factors[h][owner] * arrivals[h]
        found.append(
            TimedPath(
                np.concatenate([[0.0], times, [end_s]]),
                np.concatenate([path[:1], actions.path, path[-1:]]),
                np.concatenate([[-1], owner, [len(actions) - 1]]),
            )
        )
    return found
