"""How soon the first policies are done: a quick estimate of what heads can reach."""

from __future__ import annotations

from decmcts.team.engine.plans import TUNED, encode
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import resolve

PUT = 100_000  # contours put for one estimate, about half a second's work
LEAST = 4  # policies tried at least, the first ones


def first_policies_s(problem: TeamProblem) -> float:
    """Return the shortest makespan of the first policies, all heads by the same one, s."""
    heads = range(len(problem.machine.heads))
    count = min(TUNED, max(LEAST, PUT // max(1, len(problem.macro))))
    plans = [encode(policy, problem.n_macros) for policy in range(count)]
    return min(resolve(problem, dict.fromkeys(heads, plan), heads).makespan_s for plan in plans)
