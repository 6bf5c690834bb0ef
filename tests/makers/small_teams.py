"""The least makespan of small prints: every joint order the engine can carry out, tried.

A joint order says who prints what, in which direction, in one order of all. They are tried
depth first, contour after contour; the engine says when and how each is printed
(`decmcts.team.engine.aside_kernels`). Two kinds of beginnings are not followed further, and neither
can lose the optimum: those whose bound is no better than the best order known, and those in
which every head has done the same actions at the same times as in another that was tried.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

import numba
import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.feasibility.build import build_graph
from decmcts.team.engine.aside_kernels import print_next, return_all
from decmcts.team.engine.joint_kernels import NONE, TeamState, Units, Visits, all_parked, new_units
from decmcts.team.engine.plans import StatedOrder
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.replay_kernels import Marks, mark, restore
from decmcts.team.engine.spaces_kernels import Fleet, travel_seconds
from tests.makers.random_machines import random_machine, random_print

F = TypeVar("F", bound=Callable[..., Any])
CLOSE = 1e-9  # share of a makespan; orders nearer than that are equally good
TABLE = 1 << 22  # states remembered; more are tried again rather than forgotten
FILLED = 0.7  # share of the table that is used
SEED_HASH = 1469598103934665603

_njit: Callable[..., Any] = numba.njit(nogil=True)  # not kept on disk: it changes with kernels


def compiled(function: F) -> F:
    """Compile a function at its first call, in every process anew."""
    machine_code: F = _njit(function)
    return machine_code


class Limits(NamedTuple):
    """What is known before the search, to bound the time that the rest of an order takes."""

    eligible: NDArray[np.bool_]  # (n, heads)
    topological: NDArray[np.int64]  # (n,) contours, each after what it rests on
    entered: NDArray[np.float64]  # (n,) least seconds of a travel from another contour
    left: NDArray[np.float64]  # (n, heads) least seconds from a contour to a head's park
    travel: NDArray[np.float64]  # (heads, 6) as the fleet's, without retraction


class Path(NamedTuple):
    """The order being tried; written as the search goes down and up."""

    choice: NDArray[np.int64]  # (n + 1,) (2 contour + reversed) heads + head; -1: none yet
    done: NDArray[np.bool_]  # (n,)
    chain: NDArray[np.uint64]  # (n + 1, heads) digest of each head's actions
    best: NDArray[np.int64]  # (n,) choices of the best order


@dataclass(frozen=True, slots=True)
class Least:
    """What brute force found."""

    makespan_s: float  # least of all, or the one that was to be beaten
    stated: StatedOrder | None  # None: nothing is better than what was to be beaten
    tried: int  # orders and beginnings of orders
    complete: bool  # False: stopped before all were tried


def small_problem(seed: int, heads: int, towers: int, layers: int) -> TeamProblem | None:
    """Return a print of `2 * towers * layers` contours; None: none with so many heads for it.

    Two heads can print some of it.
    """
    machine = random_machine(seed)
    if len(machine.heads) != heads:
        return None
    job = random_print(machine, seed, towers, layers)
    with suppress(InputError):
        graph = build_graph(job.contours, machine.heads, clearance_mm=machine.clearance_mm)
        problem = build_team_problem(job, machine, graph)
        if problem.space.eligible.any(axis=0).sum() > 1:
            return problem
    return None


def least_makespan(
    problem: TeamProblem, beat_s: float = np.inf, most: int = 1_000_000_000
) -> Least:
    """Return the least makespan below `beat_s`, by brute force in at most `most` steps.

    Raises
    ------
    InputError
        If something must cool: orders that differ in what is waited for are not told apart.
    """
    if len(problem.visits.lags.below):
        raise InputError("brute force takes no print in which something must cool")
    n, heads = len(problem.macro), len(problem.machine.heads)
    state = all_parked(n, problem.fleet)
    path = Path(
        np.full(n + 1, -1), np.zeros(n, np.bool_),
        np.full((n + 1, heads), SEED_HASH, np.uint64), np.full(n, -1),
    )  # fmt: skip
    marks = Marks(
        np.zeros(n + 1, np.int64), np.full((n + 1, heads), NONE), np.zeros((n + 1, heads)),
        np.empty((n + 1, heads, 3)), np.empty((n + 1, heads, 6)), np.zeros(1, np.int64),
        np.full((n + 1, heads, heads), NONE), np.empty((0, heads)),
    )  # fmt: skip
    units = new_units((n + 2) * (heads * (heads + 2) + 2))
    seen = np.zeros(TABLE, np.uint64)
    found, tried, complete = search(
        beat_s, most, problem.visits, problem.fleet, limits_of(problem), units, state, marks,
        path, seen,
    )  # fmt: skip
    stated = None
    if path.best[0] >= 0:
        visit = path.best // heads
        stated = StatedOrder((visit // 2).astype(np.int32), visit % 2 == 1, path.best % heads)
    return Least(float(found), stated, int(tried), bool(complete))


def limits_of(problem: TeamProblem) -> Limits:
    """Return what bounds the rest of an order of this problem."""
    visits, fleet = problem.visits, problem.fleet
    n, heads = len(problem.macro), len(problem.machine.heads)
    travel = fleet.travel.copy()
    travel[:, 4] = 0.0  # two short travels for a long one may do without
    between = np.array(
        [
            [_least(visits.ends[d], visits.ends[c], travel) if c != d else np.inf for d in range(n)]
            for c in range(n)
        ]
    )
    parks = [(fleet.parks[r : r + 1], travel[r : r + 1]) for r in range(heads)]
    left = np.array([[_least(ends, park, by) for park, by in parks] for ends in visits.ends])
    order = _topological(problem)
    return Limits(problem.space.eligible, order, between.min(axis=1, initial=np.inf), left, travel)


def _least(
    begin: NDArray[np.float64], end: NDArray[np.float64], travel: NDArray[np.float64]
) -> float:
    """Return the least seconds from one of some points to one of others, by any head."""
    return min(float(travel_seconds(p, q, by)) for p in begin for q in end for by in travel)


def _topological(problem: TeamProblem) -> NDArray[np.int64]:
    """Return the contours, each after what it rests on."""
    graph, placed = problem.graph, np.zeros(len(problem.macro), np.bool_)
    order: list[int] = []
    while len(order) < len(placed):
        for c in np.flatnonzero(~placed):
            before = graph.preds[graph.pred_offsets[c] : graph.pred_offsets[c + 1]]
            if placed[before].all():
                order.append(int(c))
                placed[c] = True
    return np.array(order, np.int64)


@compiled
def search(
    best: float, most: int, visits: Visits, fleet: Fleet, limits: Limits, units: Units,
    heads: TeamState, marks: Marks, path: Path, seen: NDArray[np.uint64],
) -> tuple[float, int, bool]:  # fmt: skip
    """Try all joint orders (mutates all but the problem); least makespan, steps, whether all."""
    n, depth, tried, filled = len(path.done), 0, 0, 0
    mark(0, units, heads, marks)
    while depth >= 0:
        restore(depth, units, heads, marks)
        if not next_choice(depth, visits, limits, path):
            depth -= 1
            continue
        tried += 1
        if tried > most:
            return best, tried - 1, False
        visit, r = path.choice[depth] // len(heads.free), path.choice[depth] % len(heads.free)
        if not print_next(r, visit // 2, visit % 2 == 1, visits, fleet, units, heads):
            continue
        if depth + 1 == n:
            if return_all(visits, fleet, units, heads):
                makespan = heads.free.max()
                if makespan < best * (1.0 - CLOSE):
                    best = makespan
                    path.best[:] = path.choice[:n]
            continue
        if bound(path.done, visits, fleet, limits, heads) >= best * (1.0 - CLOSE):
            continue
        filled, known = remember(filled, depth, units, heads, marks, path, seen)
        if known:
            continue
        depth += 1
        path.choice[depth] = -1
        mark(depth, units, heads, marks)
    return best, tried, True


@compiled
def next_choice(depth: int, visits: Visits, limits: Limits, path: Path) -> bool:
    """Take back the choice at a depth and make the next (mutates path); False: there is none."""
    n, heads = limits.eligible.shape
    at = path.choice[depth]
    if at >= 0:
        path.done[at // heads // 2] = False
    for k in range(at + 1, 2 * n * heads):
        c, is_reversed, r = k // heads // 2, k // heads % 2 == 1, k % heads
        if path.done[c] or not limits.eligible[c, r] or (is_reversed and not visits.reversible[c]):
            continue
        ready = True
        for row in range(visits.pred_offsets[c], visits.pred_offsets[c + 1]):
            if not path.done[visits.preds[row]]:
                ready = False
        if ready:
            path.choice[depth] = k
            path.done[c] = True
            return True
    return False


@compiled
def bound(
    done: NDArray[np.bool_], visits: Visits, fleet: Fleet, limits: Limits, heads: TeamState
) -> float:
    """Return a time before which no way to complete the order can end.

    Every contour left begins no sooner than a head can be there and than what it rests on
    ends; all of them share the time the heads have left before they must return.
    """
    n, count = limits.eligible.shape
    earliest, least, work = np.zeros(n), 0.0, 0.0
    home = np.empty(count)  # seconds each head needs for its way back, at least
    useful = np.zeros(count, np.bool_)
    for r in range(count):
        home[r] = travel_seconds(heads.at[r], fleet.parks[r], limits.travel[r])
        least = max(least, heads.free[r] + home[r])
    for k in range(n):
        c = limits.topological[k]
        if done[c]:
            earliest[c] = heads.ended[c]
            continue
        soonest, entered, left, printed = np.inf, limits.entered[c], np.inf, np.inf
        for r in range(count):
            if not limits.eligible[c, r]:
                continue
            useful[r] = True
            home[r] = min(home[r], limits.left[c, r])
            left = min(left, limits.left[c, r])
            printed = min(printed, visits.seconds[r, c])
            there = np.inf
            for side in range(2):
                there = min(
                    there, travel_seconds(heads.at[r], visits.ends[c, side], limits.travel[r])
                )
            entered = min(entered, there)
            soonest = min(soonest, heads.free[r] + there)
        for row in range(visits.pred_offsets[c], visits.pred_offsets[c + 1]):
            soonest = max(soonest, earliest[visits.preds[row]])
        earliest[c] = soonest + printed
        least = max(least, earliest[c] + left)
        work += printed + entered
    return max(least, shared(work, heads.free + home, useful))


@compiled
def shared(work: float, begun: NDArray[np.float64], useful: NDArray[np.bool_]) -> float:
    """Return when heads that begin at these times have done so many seconds of work in all."""
    times = np.sort(begun[useful])
    end = np.inf
    for k in range(1, len(times) + 1):
        end = min(end, (work + times[:k].sum()) / k) if k == 1 or times[k - 1] < end else end
    return end


@compiled
def remember(
    filled: int, depth: int, units: Units, heads: TeamState, marks: Marks, path: Path,
    seen: NDArray[np.uint64],
) -> tuple[int, bool]:  # fmt: skip
    """Remember the state reached at a depth (mutates path, seen); return how many, and if known."""
    count = len(heads.free)
    for r in range(count):
        path.chain[depth + 1, r] = path.chain[depth, r]
    for u in range(marks.used[depth], units.used[0]):
        r = units.head[u]
        word = mixed(path.chain[depth + 1, r], np.uint64(units.contour[u] + 1))
        word = mixed(word, np.uint64(2 * units.kind[u] + units.reversed[u]))
        word = mixed(word, bits(units.begin[u]))
        for axis in range(3):
            word = mixed(word, bits(units.target[u, axis]))
        path.chain[depth + 1, r] = word
    word = np.uint64(SEED_HASH)
    for r in range(count):
        word = mixed(word, path.chain[depth + 1, r])
    word = max(word, np.uint64(1))
    row = np.int64(word % np.uint64(len(seen)))
    while seen[row] != 0:
        if seen[row] == word:
            return filled, True
        row = (row + 1) % len(seen)
    if filled < FILLED * len(seen):
        seen[row] = word
        filled += 1
    return filled, False


@compiled
def bits(value: float) -> np.uint64:
    """Return a number's own 64 bits; of both zeros the same."""
    return np.array([value + 0.0]).view(np.uint64)[0]  # type: ignore[no-any-return]  # numpy


@compiled
def mixed(state: np.uint64, word: np.uint64) -> np.uint64:
    """Return a digest that has taken in one more word (the finalizer of splitmix64)."""
    x = (state ^ word) + np.uint64(0x9E3779B97F4A7C15)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))
