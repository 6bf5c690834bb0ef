"""Changes of plans that say what is done otherwise than in the order heads begin with."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from decmcts.team.engine.plans import MOST_LATER, Changes, decode, encode_changes
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.start import StartingOrder

NEAR_MM = 8.0  # macro-actions of different layers no farther apart lie above one another
GIVE, MOVE = 0.35, 0.8  # chance of a gift, and of that or another turn; else as at first

Plan = NDArray[np.int32]
Ints = NDArray[np.int64]


def rearranges(problem: TeamProblem, plan: Plan) -> bool:
    """Whether a plan changes the order heads begin with."""
    return problem.start is not None and _intent(problem, plan) is not None


def rearranged(
    problem: TeamProblem, plans: Mapping[int, Plan], rng: np.random.Generator
) -> dict[int, Plan]:
    """Return plans of these heads after the same random move in each.

    A move is of macro-actions above one another, on some layers: each head gives its own to a
    neighbour, has another turn with them, or does as at first.
    """
    start = problem.start
    assert start is not None
    move = rng.random()
    later = _half_turns(rng)
    made = {}
    for r, plan in plans.items():
        change = _intent(problem, plan) or Changes(*np.zeros((3, 0), np.int64))
        by, to = np.zeros(start.n_macros, np.int64), start.head.copy()
        by[change.macro], to[change.macro] = change.later, change.head
        chosen = _above_one_another(start, r, rng)
        if move < GIVE:
            to[chosen] = _neighbour(r, problem.row, rng) if (to[chosen] == r).all() else r
        elif move < MOVE:
            by[chosen] = np.clip(by[chosen] + later, -MOST_LATER, MOST_LATER)
        else:
            by[chosen], to[chosen] = 0, r
        rows = np.flatnonzero((by != 0) | (to != start.head))
        made[r] = encode_changes(Changes(rows, by[rows], to[rows]), problem.n_macros)
    return made


def _intent(problem: TeamProblem, plan: Plan) -> Changes | None:
    return decode(plan, problem.n_macros, len(problem.macro)).changes


def _half_turns(rng: np.random.Generator) -> int:
    """Return by how much later: past the neighbouring macro-action, or some."""
    return int(rng.choice((-1, 1))) * (1 + 2 * int(rng.geometric(0.5)))


def _neighbour(r: int, row: Ints, rng: np.random.Generator) -> int:
    place = int(np.flatnonzero(row == r)[0])
    return int(row[rng.choice([p for p in (place - 1, place + 1) if 0 <= p < len(row)])])


def _above_one_another(start: StartingOrder, r: int, rng: np.random.Generator) -> Ints:
    """Return macro-actions of a head at one place of some layers, all or every second one."""
    own = np.flatnonzero(start.head == r)
    if not len(own):
        return own
    first = int(own[rng.integers(len(own))])
    layers = int(rng.geometric(min(1.0, 4.0 / (int(start.layer.max()) + 1))))
    above = start.layer[own] - start.layer[first]
    here = np.abs(start.middle_mm[own] - start.middle_mm[first]) <= NEAR_MM
    here &= (above >= 0) & (above < layers) & (above % int(rng.integers(1, 3)) == 0)
    return np.asarray(own[here | (own == first)])
