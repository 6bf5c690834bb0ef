"""Hostile plans on machines made at random: each must resolve, and the judge must agree.

    python -m tests.makers.random_teams [--machines 100] [--plans 100] [--seed 0]

Prints how many plans resolved to a joint order the judge accepts, and of the others why.
`benchmarks/random_teams.py` does the same for the presets too, resumably, with a table.
"""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.feasibility.build import build_graph
from decmcts.print.machine import Machine
from decmcts.print.plan import ActionKind, JointPlan, OrderRules, PlanDocument
from decmcts.print.toolpath import Toolpath
from decmcts.team.engine.plans import POLICIES, encode, encode_serial
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.resolve import resolve
from decmcts.team.schedule.joint_plan import schedule
from sim.faults import Verdict
from sim.verify import verify_plan
from tests.makers.random_machines import random_machine, random_print

RULES = OrderRules(quality=False, freedom="reversible")
KINDS = ("sensible", "shuffled", "all for each", "nonsense", "none", "one order", "bad order",
         "stated")  # fmt: skip

Plans = dict[int, NDArray[np.int32]]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of the plans of all heads."""

    plan: JointPlan | None  # None: they did not resolve
    fault: str  # what is wrong, nothing if all is well

    @property
    def shared_s(self) -> float:
        """Nominal seconds in which two heads or more print."""
        return 0.0 if self.plan is None else shared_seconds(self.plan)


def random_plans(problem: TeamProblem, rng: np.random.Generator, kind: str) -> Plans:
    """Return plans of all heads, of one of `KINDS`; "mixed": of any, head by head."""
    heads = range(len(problem.machine.heads))
    kinds = [kind if kind != "mixed" else str(rng.choice(KINDS)) for _ in heads]
    return {r: _plan(problem, r, rng, kind) for r, kind in zip(heads, kinds, strict=True)}


def _plan(problem: TeamProblem, r: int, rng: np.random.Generator, kind: str) -> NDArray[np.int32]:
    """Return a plan of head r."""
    m, n = problem.n_macros, len(problem.macro)
    if kind == "nonsense":
        return rng.integers(-5, 3 * m + 3 * n, int(rng.integers(2 * n))).astype(np.int32)
    if kind == "none":
        return np.empty(0, np.int32)
    if kind == "stated":
        return _stated(problem, rng)
    if kind in ("one order", "bad order"):
        order = random_order(problem, rng) if kind == "one order" else rng.permutation(n)
        is_reversed = rng.random(n) < 0.5
        return encode_serial(Toolpath.of(order.astype(np.int32), is_reversed), m)
    most = {"sensible": 30, "all for each": 300}.get(kind, 1000)
    shift = rng.integers(-most, most, m).astype(np.int32)
    return encode(int(rng.integers(len(POLICIES))), m, shift)


def _stated(problem: TeamProblem, rng: np.random.Generator) -> NDArray[np.int32]:
    """Return a plan that says of every contour who prints it and how, in any order."""
    heads, n = len(problem.machine.heads), len(problem.macro)
    order = random_order(problem, rng) if rng.random() < 0.7 else rng.permutation(n)
    head = rng.integers(heads, size=n)
    if rng.random() < 0.7:
        head = (problem.space.eligible[order] * rng.random((n, heads))).argmax(axis=1)
    is_reversed = (rng.random(n) < 0.5) & problem.visits.reversible[order]
    symbols = (2 * order + is_reversed) * heads + head
    mark = problem.n_macros + len(POLICIES) + 1
    return np.concatenate([[mark, heads], symbols]).astype(np.int32)


def random_order(problem: TeamProblem, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return all contours in a random order that keeps the precedence."""
    graph, n = problem.graph, len(problem.macro)
    missing = np.diff(graph.pred_offsets).copy()
    ready, order = np.flatnonzero(missing == 0).tolist(), []
    while ready:
        contour = ready.pop(int(rng.integers(len(ready))))
        order.append(contour)
        for after in graph.succs[graph.succ_offsets[contour] : graph.succ_offsets[contour + 1]]:
            missing[after] -= 1
            if not missing[after]:
                ready.append(int(after))
    assert len(order) == n
    return np.array(order, np.int64)


def outcome(problem: TeamProblem, plans: Plans) -> Outcome:
    """Return what plans resolve to, and what the judge finds wrong with it."""
    try:
        found = resolve(problem, plans, range(len(problem.machine.heads)))
        plan = schedule(problem.job, problem.machine, problem.graph, found.toolpaths)
    except InputError as error:
        return Outcome(None, error.what)
    verdict = judged(problem, plan)
    return Outcome(plan, "" if verdict.ok else str(verdict.faults[0]))


def judged(problem: TeamProblem, plan: JointPlan, trials: int = 1) -> Verdict:
    """Return what the judge makes of a joint plan."""
    pairs = problem.graph.pairs()
    document = PlanDocument(
        problem.digest, problem.machine, problem.job.contours, pairs, plan, {}, rules=RULES
    )
    return verify_plan(document, source=problem.job, trials=trials)


def shared_seconds(plan: JointPlan) -> float:
    """Return for how many nominal seconds two heads or more print."""
    steps = []
    for actions in plan.heads:
        prints = actions.kind == ActionKind.PRINT
        steps += [(float(t), 1) for t in actions.begin_s[prints]]
        steps += [(float(t), -1) for t in actions.end_s[prints]]
    steps.sort()
    printing, shared, last = 0, 0.0, 0.0
    for at, step in steps:
        shared += (at - last) * (printing > 1)
        printing, last = printing + step, at
    return shared


def problem_of(seed: int) -> TeamProblem:
    """Return the problem of a random print on a random machine; InputError where it has none."""
    return problem_on(random_machine(seed), seed)


def problem_on(machine: Machine, seed: int) -> TeamProblem:
    """Return the problem of a random print on this machine; InputError where it has none."""
    job = random_print(machine, seed)
    graph = build_graph(job.contours, machine.heads, clearance_mm=machine.clearance_mm)
    return build_team_problem(job, machine, graph)


def main() -> None:
    """Run the experiment and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=100)
    parser.add_argument("--plans", type=int, default=100, help="of each machine")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    counts: Counter[str] = Counter()
    for seed in range(options.seed, options.seed + options.machines):
        try:
            problem = problem_of(seed)
        except InputError as error:
            counts[f"no problem: {error.what[:60]}"] += 1
            continue
        rng = np.random.default_rng([seed, 3])
        for k in range(options.plans):
            kind = (*KINDS, "mixed")[k % (len(KINDS) + 1)]
            found = outcome(problem, random_plans(problem, rng, kind))
            counts[f"at fault: {kind}" if found.fault else "accepted"] += 1
            if found.fault:
                print(problem.machine.name, kind, k, found.fault, flush=True)
    for what, count in counts.most_common():
        print(f"{count:6d}  {what}")


if __name__ == "__main__":
    main()
