"""One planner of a team on one print: what the tables of teams are made of.

    python benchmarks/team_run.py '{"plate": "mix_2", "heads": 2, "method": "annealing", …}'

Prints one JSON object. Called by `teams.py`, `team_growth.py` and `team_ablation.py`, a
process a run, so that memory and processor time are its own. `cpu_s` is processor
time of the search; kernels are compiled, or loaded, before. Real agents (method
`processes`) get seconds on the clock, so many that all cores together give as much.
Every plan is judged for every timing its order allows.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from common import own_process
from team_baselines import annealing, policies
from team_prints import swept_problem, team_problem

from agents.launch import launch
from decmcts.experiments.decentral_or_central import OneTree
from decmcts.experiments.teams import in_one_process
from decmcts.planning.problem.planned import document_of
from decmcts.planning.problem.print_problem import PrintProblem
from decmcts.print.plan import JointPlan
from decmcts.print.toolpath import Toolpath
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.bounds.makespan import makespan_bound
from decmcts.team.dec_mcts.parameters import changed
from decmcts.team.dec_mcts.planner import BestJointPlan, DecMcts, Parameters
from decmcts.team.dec_mcts.rounds import plan_once
from decmcts.team.dec_mcts.warm_up import compile_rounds
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import resolve
from decmcts.team.incumbent import Budget
from decmcts.team.schedule.joint_plan import schedule
from sim.verify import verify_plan
from tests.makers.random_teams import judged

PROCESSES, TOGETHER = "processes", "one-process"
BASELINES = {"greedy-dispatch": policies, "annealing": annealing}
METHODS = (PROCESSES, TOGETHER, *BASELINES)
Paths = tuple[Toolpath, ...]
Figures = dict[str, Any]


class NoTree(DecMcts):
    """Dec-MCTS whose plans come from policies and joint exchanges alone."""

    def _sample(self, team: tuple[int, ...]) -> None:
        """Leave the tree as it is."""


# What each variant sets; those without settings leave out what no parameter does.
SETTINGS: dict[str, dict[str, Any]] = {
    "all": {},
    "no tree": {},
    "no messages": {},
    "q frozen": {"alpha": 0.0},
    "windows alone": {"share": 0.0},
    "one tree": {},
    "no windows": {"windows": 0},
    "one tree alone": {"windows": 0},
    "annealing": {},
    "no recreation": {"recreate": 0.0},
    "no piecewise release": {},
}
VARIANTS = tuple(SETTINGS)
ONE_TREE = ("one tree", "one tree alone")
ALONE = ("no messages", *ONE_TREE)


def run(key: dict[str, Any]) -> Figures:
    """Plan, schedule and judge; `key` has plate, heads, method, seed and cpu_s."""
    whole = key["method"] == "no piecewise release"
    if key.get("swept"):
        given, problem = swept_problem(key["plate"], whole=whole)
    else:
        given, problem = None, team_problem(key["plate"], key["heads"], whole=whole)
    paths, figures = planner_of(key["method"])(problem, key["cpu_s"], key["seed"])
    plan = schedule(problem.job, problem.machine, problem.graph, paths)
    return {"contours": len(problem.macro), **figures, **judgement(problem, plan, given)}


def judgement(problem: TeamProblem, plan: JointPlan, given: PrintProblem | None = None) -> Figures:
    """Return makespan, bound and what the judge finds; `given` may be cut."""
    bound = makespan_bound(problem.job, problem.machine, problem.graph).bound_s
    if given is None:
        verdict = judged(problem, plan)
    else:
        source = (given.whole or given).job
        verdict = verify_plan(document_of(given, plan, {}), source=source, trials=1)
    return {
        "makespan_s": round(plan.makespan_s, 2),
        "bound_s": round(bound, 2),
        "over_bound": round(plan.makespan_s / bound, 4),
        "faults": len(verdict.faults),
    }


def planner_of(method: str) -> Callable[[TeamProblem, float, int], tuple[Paths, Figures]]:
    """Return what plans by this method, in so many seconds of processor time."""
    if method == PROCESSES:
        return by_processes
    if method in VARIANTS and method not in BASELINES:
        return lambda problem, cpu_s, seed: by_variant(problem, cpu_s, seed, method)
    if method == TOGETHER:
        return together
    planner = BASELINES[method]

    def plan(problem: TeamProblem, cpu_s: float, seed: int) -> tuple[Paths, Figures]:
        planner(problem, Budget(Stopping(iterations=1)), seed=seed)  # compiles or loads its kernels
        began = time.process_time()
        found = planner(problem, Budget(Stopping(cpu_s)), seed=seed)
        spent = time.process_time() - began
        history = [(round(s, 3), round(makespan, 2)) for s, makespan in found.history]
        figures = {"spent_s": round(spent, 2), "orders": found.orders, "history": history}
        return found.toolpaths, figures

    return plan


def together(problem: TeamProblem, cpu_s: float, seed: int) -> tuple[Paths, Figures]:
    """Plan by all heads in turn in this process."""
    compile_rounds()
    in_one_process(problem, Stopping(iterations=1), seed=seed)
    began = time.process_time()
    paths = in_one_process(problem, Stopping(cpu_s), seed=seed)
    return paths, {"spent_s": round(time.process_time() - began, 2)}


def by_processes(problem: TeamProblem, cpu_s: float, seed: int) -> tuple[Paths, Figures]:
    """Plan by one agent a head, each a process; a head alone plans in its own."""
    heads = len(problem.machine.heads)
    wall_s = cpu_s / min(heads, os.cpu_count() or 1)
    before = children_s()
    stopping = Stopping(wall_s)
    result = launch(problem.job, problem.machine, problem.graph, stopping=stopping, seed=seed)
    agents = result.agreement.agents
    best, history = float("inf"), []
    for seconds, makespan in sorted(h for agent in agents for h in agent.history):
        if makespan < best:
            best = makespan
            history.append((round(seconds, 2), round(makespan, 2)))
    kept = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    return result.toolpaths, {
        "spent_s": round(children_s() - before, 2),  # reading the print and loading included
        "limit_s": round(wall_s, 2),
        "rounds": sum(agent.rounds for agent in agents),
        "messages": sum(sum(agent.sent.values()) for agent in agents),
        "bytes": sum(sum(agent.sent_bytes.values()) for agent in agents),
        "agent_mib": round(kept),
        "history": history,
    }


def children_s() -> float:
    """Return the processor time of all processes that were started and have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def by_variant(
    problem: TeamProblem, cpu_s: float, seed: int, variant: str
) -> tuple[Paths, Figures]:
    """Plan by all heads in turn in this process, with a part left out or done otherwise."""
    heads = list(range(len(problem.machine.heads)))
    parameters = changed(Parameters.for_contours(len(problem.macro)), SETTINGS[variant])
    made = NoTree if variant == "no tree" else OneTree if variant in ONE_TREE else DecMcts
    searching = heads[:1] if variant in ONE_TREE else heads
    team = [made(problem, r, seed=seed, parameters=parameters) for r in searching]
    compile_rounds()
    for agent in team:
        agent.best(heads)
    began, turns = time.process_time(), 0
    best: BestJointPlan | None = None
    history: list[tuple[float, float]] = []
    entropy: list[tuple[float, float]] = []
    while (spent_s := time.process_time() - began) < cpu_s or best is None:
        agent = team[turns % len(team)]
        spent = spent_s / cpu_s if cpu_s > 0.0 else 1.0
        best = one_turn(agent, team, heads, spent, best, messages=variant not in ALONE)
        turns += 1
        at = round(time.process_time() - began, 2)
        if not history or best.makespan_s < history[-1][1]:
            history.append((at, best.makespan_s))
        mean = sum(each.distribution.entropy for each in team) / len(team)
        entropy.append((at, round(mean, 4)))
    return resolve(problem, best.plans, heads).toolpaths, {
        "spent_s": round(spent_s, 2),
        "rounds": turns // len(team),
        "history": [(at, round(value, 2)) for at, value in history],
        "entropy": entropy,
    }


def one_turn(
    agent: DecMcts,
    team: list[DecMcts],
    live: list[int],
    spent: float,
    best: BestJointPlan | None,
    *,
    messages: bool,
) -> BestJointPlan:
    """Let a head take a turn, as in `plan_in_turn`; return the best joint plan so far."""
    if messages:
        return plan_once(agent, team, spent, best)
    agent.iterate(live, spent)
    found = agent.best(live)
    return found if best is None or found.makespan_s < best.makespan_s else best


def in_own_process(key: Figures, timeout_s: float = 7200.0) -> Figures:
    """Make one run in a process of its own; returns its row with the largest process' memory."""
    command = [sys.executable, str(Path(__file__).resolve()), json.dumps(key)]
    done = own_process(command, timeout_s=timeout_s)
    row = {"error": "", **key, **done, "peak_mib": round(done["peak_mib"])}
    del row["wall_s"], row["exit"]
    return row


if __name__ == "__main__":
    print(json.dumps(run(json.loads(sys.argv[1]))))
