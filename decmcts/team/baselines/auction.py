"""Sequential single-item auctions with makespan bids and precedence, repeated.

Contours are offered as soon as all they rest on is assigned, the most urgent first. Each
head bids the time at which it would have printed the contour, travel and waits for room
included, and the lowest bid wins. Then all is auctioned again with other priorities: those
of the best auction, changed a little. Heads append what they win, since an insertion into a
head's schedule would move the room of everything after it.

References
----------
Nunes & Gini 2015, "Multi-robot auctions for allocation of tasks with temporal
constraints" (TeSSI), AAAI 29(1).
Nunes, McIntire & Gini 2017, "Decentralized multi-robot allocation of tasks with
temporal and precedence constraints", Advanced Robotics 31(22), 1193-1207.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.engine.dispatch import URGENCY
from decmcts._kernels.engine.joint import Units
from decmcts._kernels.refine.auction import auction
from decmcts.team.baselines.incumbent import Budget, Found, Incumbent
from decmcts.team.engine.order import refuse
from decmcts.team.engine.plans import POLICIES
from decmcts.team.engine.policy import keys_of, policy_of
from decmcts.team.engine.problem import TeamProblem

ON_OFFER = (1, 2, 4, 8, 16, 64)  # contours bid for at a time, tried at first
CHANGED = 0.1  # share of the macro-actions whose priority is changed
STEP = 0.2  # of a priority, standard deviation


@dataclass(frozen=True, slots=True)
class Priorities:
    """What an auction is held by."""

    on_offer: int
    by_urgency: float  # see `keys_of`
    shift: NDArray[np.float64]  # (n_macros,) of the keys of a macro-action's contours


def held(problem: TeamProblem, priorities: Priorities) -> Units:
    """Hold one auction of everything."""
    weights = np.zeros((len(problem.machine.heads), POLICIES.shape[1]))
    weights[:, URGENCY] = priorities.by_urgency
    keys = keys_of(problem, weights) + priorities.shift[problem.macro]
    policy = policy_of(problem, weights, keys, problem.space.eligible)
    units, verdict = auction(problem.visits, problem.fleet, policy, priorities.on_offer)
    refuse(verdict, problem.machine)
    return units


def changed(best: Priorities, rng: np.random.Generator) -> Priorities:
    """Return priorities near these."""
    n = len(best.shift)
    moved = rng.random(n) < max(CHANGED, 1.0 / max(n, 1))
    shift = best.shift + moved * rng.normal(0.0, STEP, n)
    changed_ = replace(best, shift=shift)
    if rng.random() < 0.1:
        changed_ = replace(changed_, on_offer=int(rng.choice(ON_OFFER)))
    if rng.random() < 0.1:
        changed_ = replace(changed_, by_urgency=float(rng.uniform()))
    return changed_


def plan(problem: TeamProblem, budget: Budget, *, seed: int) -> Found:
    """Return the best of auctions repeated until the time is over."""
    rng, best = np.random.default_rng(seed), Incumbent(budget, len(problem.machine.heads))
    plain = np.zeros(problem.n_macros)
    first = [Priorities(k, u, plain) for k in ON_OFFER for u in (1.0, 0.0)]
    kept = first[0]
    while not best.ended:
        tried = first[best.orders] if best.orders < len(first) else changed(kept, rng)
        before = best.makespan_s
        if best.offer(held(problem, tried)) <= before:
            kept = tried
    return best.found
