"""Changes of a plan: the moves of the search over a head's plans."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from decmcts.team.dec_mcts.rearrange import rearranged, rearranges
from decmcts.team.engine.plans import HUNDREDTHS, decode, encode
from decmcts.team.engine.policy import beside
from decmcts.team.engine.problem import TeamProblem

SHIFT_SPREAD = 0.3  # of a part's progress, standard deviation of a change of a shift
FEW = 5  # macro-actions shifted by themselves, at most

Plan = NDArray[np.int32]
Ints = NDArray[np.int64]


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


def _hundredths(rng: np.random.Generator, count: int) -> NDArray[np.int32]:
    """Return random shifts, none of them 0."""
    drawn = np.rint(HUNDREDTHS * rng.normal(0.0, SHIFT_SPREAD, count)).astype(np.int32)
    return np.where(drawn == 0, 1, drawn)


def _macros_of_one_part(problem: TeamProblem, rng: np.random.Generator) -> Ints:
    """Return the macro-actions of a random window of one part."""
    part = problem.macro_part
    mine = np.flatnonzero(part == part[int(rng.integers(len(part)))])
    first = int(rng.integers(len(mine)))
    return mine[first : first + 1 + int(rng.integers(len(mine)))]
