"""All heads of a team planning in one process, with perfect messages.

For tests and benchmarks; real agents are processes of their own (`agents`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from decmcts.search.sequence.stopping import Stopping
from decmcts.team.dec_mcts.planner import BestJointPlan, DecMcts, Parameters
from decmcts.team.engine.problem import TeamProblem


def plan_in_turn(
    problem: TeamProblem,
    *,
    stopping: Stopping,
    seed: int,
    parameters: Parameters | None = None,
    clock: Callable[[], float] = time.monotonic,
    progress: Callable[[int, float], None] | None = None,
) -> BestJointPlan:
    """Let every head plan in turn and return the best joint plan any of them found.

    Parameters
    ----------
    stopping : Stopping
        What ends planning; at least one round is always done. Iterations are rounds: where
        these are limited, equal seeds give equal plans.
    progress : Callable[[int, float], None] | None
        Called after each round with its number and the best makespan.
    """
    live = range(len(problem.machine.heads))
    team = [DecMcts(problem, r, seed=seed, parameters=parameters) for r in live]
    started, rounds = clock(), 0
    best: BestJointPlan | None = None

    def over() -> bool:
        return stopping.ends(clock() - started, rounds)

    while True:
        for agent in team:
            if rounds and over():
                break  # a round of many heads takes long
            best = plan_once(agent, team, stopping.spent(clock() - started, rounds), best)
        rounds += 1
        assert best is not None
        if progress is not None:
            progress(rounds, best.makespan_s)
        if over():
            return best


def plan_once(
    agent: DecMcts, team: Sequence[DecMcts], spent: float, best: BestJointPlan | None
) -> BestJointPlan:
    """Let one head take the best joint plan, plan a round and send its distribution.

    Returns the best joint plan from now on; `best` is that of all turns before, if any.
    """
    live = range(len(team))
    if best is not None and agent.knows_less_than(best, live):
        agent.take_joint(best.plans, live)
    agent.iterate(live, spent)
    for other in team:
        other.take(agent.head, agent.distribution)
    found = agent.best(live)
    return found if best is None or found.makespan_s < best.makespan_s else best
