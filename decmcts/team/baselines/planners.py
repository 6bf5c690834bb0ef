"""All planners of teams by name: the baselines, and Dec-MCTS itself in one process."""

from __future__ import annotations

from collections.abc import Callable

from decmcts.team.baselines import (
    annealing,
    auction,
    greedy_dispatch,
    joint_tree,
    one_head,
    regret_matching,
    static_split,
)
from decmcts.team.baselines.incumbent import Budget, Found, Incumbent
from decmcts.team.dec_mcts.rounds import plan_in_turn
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import resolve

Plan = Callable[..., Found]  # (problem, budget, *, seed)

BASELINES: dict[str, Plan] = {
    "one-head": one_head.plan,
    "static-split": static_split.plan,
    "greedy-dispatch": greedy_dispatch.plan,
    "auction": auction.plan,
    "regret-matching": regret_matching.plan,
    "annealing": annealing.plan,
    "joint-mcts": joint_tree.plan,
}


def in_one_process(problem: TeamProblem, budget: Budget, *, seed: int) -> Found:
    """Return what all heads' Dec-MCTS find in turn; its iterations are rounds."""
    heads = range(len(problem.machine.heads))
    best = Incumbent(budget, len(heads))
    proposal = plan_in_turn(problem, stopping=budget.stopping, seed=seed, clock=budget.clock)
    found = resolve(problem, proposal.plans, heads)
    best.offer_toolpaths(found.toolpaths, found.makespan_s)
    return best.found
