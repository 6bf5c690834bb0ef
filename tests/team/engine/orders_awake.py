"""Prints digests of joint orders whose heads sleep while nothing opens, then of heads that don't.

A program for an interpreter with NUMBA_DISABLE_JIT=1: there the engine's parts can be exchanged.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from decmcts.print.lags_kernels import Lags
from decmcts.team.engine import dispatch_kernels as dispatch
from decmcts.team.engine.plans import encode
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.resolve import resolve
from tests.makers.random_teams import problem_of

SEEDS = (5, 9, 33, 40)  # of machines: two heads on a rail along y, three on two rails and on one
POLICIES = (0, 5, 60)
looks = [0]
look = dispatch.choose


def counted(*given: object) -> object:
    looks[0] += 1
    return look(*given)  # type: ignore[arg-type]


def cooling(problem: TeamProblem) -> TeamProblem:
    """Return the same problem where everything must cool on what it rests on for 3 s."""
    graph = problem.graph
    lags = Lags(graph.pred_offsets, graph.preds, np.full(len(graph.preds), 3.0))
    return build_team_problem(problem.job, problem.machine, graph, lags)


def rouse(r: int, start: float, *given: Any) -> None:
    """Let all other heads decide again, whatever head r has placed."""
    pool = given[-1]
    for s in range(len(pool.decides_at)):
        if s != r:
            pool.decides_at[s] = min(pool.decides_at[s], start)


def digests() -> list[str]:
    """Return digests of joint orders, and how often heads looked."""
    looks[0] = 0
    found = []
    for seed in SEEDS:
        for problem in (problem_of(seed), cooling(problem_of(seed))):
            heads = range(len(problem.machine.heads))
            for policy in POLICIES:
                plans = {r: encode(policy, problem.n_macros) for r in heads}
                found.append(resolve(problem, plans, heads).digest)
    return [" ".join(found), str(looks[0])]


if __name__ == "__main__":
    dispatch.choose = counted
    asleep = digests()
    dispatch.wake = rouse
    print(*asleep, *digests(), sep="\n")
