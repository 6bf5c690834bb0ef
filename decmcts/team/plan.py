"""All heads of a team planning in one process, with perfect messages.

For tests and benchmarks; real agents are processes of their own (`agents`).
"""

from __future__ import annotations

import time
from collections.abc import Callable

from decmcts.team.dec_mcts import DecMcts, Parameters, Proposal
from decmcts.team.problem import TeamProblem


def plan_team(
    problem: TeamProblem,
    *,
    time_limit_s: float,
    seed: int,
    max_rounds: int | None = None,
    parameters: Parameters | None = None,
    clock: Callable[[], float] = time.monotonic,
    progress: Callable[[int, float], None] | None = None,
) -> Proposal:
    """Let every head plan in turn and return the best joint plan any of them found.

    Parameters
    ----------
    time_limit_s : float
        Wall clock; at least one round is always done.
    max_rounds : int | None
        Limit on rounds; with it, equal seeds give equal plans.
    progress : Callable[[int, float], None] | None
        Called after each round with its number and the best makespan.
    """
    heads = range(len(problem.machine.heads))
    team = [DecMcts(problem, r, seed=seed, parameters=parameters) for r in heads]
    started, rounds = clock(), 0

    def spent() -> float:
        by_time = (clock() - started) / time_limit_s if time_limit_s > 0.0 else 1.0
        return max(by_time, rounds / max_rounds if max_rounds else 0.0)

    while True:
        for agent in team:
            if rounds and spent() >= 1.0:
                break  # a round of many heads takes long
            agent.iterate(list(heads), spent())
            told = agent.best(list(heads))
            for other in team:
                other.take(agent.head, agent.distribution)
                if told.makespan_s < other.best(list(heads)).makespan_s:
                    other.take_joint(told.plans, list(heads))
        rounds += 1
        best = min((agent.best(list(heads)) for agent in team), key=lambda found: found.makespan_s)
        if progress is not None:
            progress(rounds, best.makespan_s)
        if spent() >= 1.0:
            return best
