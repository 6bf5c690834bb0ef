"""Changes of a plan: the moves of the search over a head's plans.

Where heads begin with a sweep, plans state what is done otherwise than in it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from decmcts.arrays import Int32s, Ints
from decmcts.team.dec_mcts.policy_trials import beside
from decmcts.team.engine.plans import (
    HUNDREDTHS,
    MOST_LATER,
    Changes,
    decode,
    encode,
    encode_changes,
)
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.start import StartingOrder

NEAR_MM = 8.0  # macro-actions of different layers no farther apart lie above one another
GIVE, MOVE = 0.35, 0.8  # chance of a gift, and of that or another turn; else as at first


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
    later = int(rng.choice((-1, 1))) * (1 + 2 * int(rng.geometric(0.5)))  # past one or more
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


SHIFT_SPREAD = 0.3  # of a part's progress, standard deviation of a change of a shift
FEW = 5  # macro-actions shifted by themselves, at most

Plan = Int32s


def exchange(problem: TeamProblem, head: int, plan: Plan, rng: np.random.Generator) -> Plan:
    """Return a plan of a head after one random move; a serial plan becomes an ordinary one."""
    return _moved(problem, {head: plan}, rng)[head]


def exchange_jointly(
    problem: TeamProblem, plans: Mapping[int, Plan], rng: np.random.Generator
) -> dict[int, Plan]:
    """Return the plans of all heads after one move of one head, or one they make together."""
    if rng.random() < 0.5:
        return {**plans, **_moved(problem, plans, rng)}
    head = sorted(plans)[int(rng.integers(len(plans)))]
    return {**plans, **_moved(problem, {head: plans[head]}, rng)}


def _moved(
    problem: TeamProblem, plans: Mapping[int, Plan], rng: np.random.Generator
) -> dict[int, Plan]:
    """Return these plans after the same random move in each."""
    if any(rearranges(problem, plan) for plan in plans.values()):
        return rearranged(problem, plans, rng)
    intents = {r: decode(p, problem.n_macros, len(problem.macro)) for r, p in plans.items()}
    row = {r: intent.policy for r, intent in intents.items()}
    later = np.zeros(problem.n_macros, np.int32)
    move = rng.random()
    if move < 0.2 or problem.n_macros == 0:
        chosen = beside(row[min(row)], rng)
        row = dict.fromkeys(row, chosen)
    elif move < 0.6:
        later[_macros_of_one_part(problem, rng)] = _hundredths(rng, 1)
    else:
        some = rng.choice(problem.n_macros, min(problem.n_macros, int(rng.integers(1, FEW + 1))))
        later[some] = _hundredths(rng, len(some))
    return {
        r: encode(row[r], problem.n_macros, intent.shift + later) for r, intent in intents.items()
    }


def _hundredths(rng: np.random.Generator, count: int) -> Int32s:
    """Return random shifts, none of them 0."""
    drawn = np.rint(HUNDREDTHS * rng.normal(0.0, SHIFT_SPREAD, count)).astype(np.int32)
    return np.where(drawn == 0, 1, drawn)


def _macros_of_one_part(problem: TeamProblem, rng: np.random.Generator) -> Ints:
    """Return the macro-actions of a random window of one part."""
    part = problem.macro_part
    mine = np.flatnonzero(part == part[int(rng.integers(len(part)))])
    first = int(rng.integers(len(mine)))
    return mine[first : first + 1 + int(rng.integers(len(mine)))]
