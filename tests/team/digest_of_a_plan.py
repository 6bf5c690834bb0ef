"""Prints the digest of what a team plans in three rounds: a program for any interpreter."""

from __future__ import annotations

from decmcts.search.sequence.stopping import Stopping
from decmcts.team.dec_mcts.rounds import plan_in_turn
from decmcts.team.engine.resolve import resolve
from tests.makers.random_teams import problem_of

SEEDS = (5, 9, 33)  # of machines: two heads on a rail along y, three on two rails and on one


def digest(seed: int) -> str:
    """Return the digest of the joint order that is planned on a random machine, and its time."""
    problem = problem_of(seed)
    heads = range(len(problem.machine.heads))
    found = plan_in_turn(problem, stopping=Stopping(iterations=3), seed=1)
    joint = resolve(problem, found.plans, heads)
    return f"{problem.digest} {joint.digest} {joint.makespan_s.hex()}"


if __name__ == "__main__":
    for seed in SEEDS:
        print(digest(seed))
