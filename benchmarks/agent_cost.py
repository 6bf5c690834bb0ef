"""What one agent of a team costs on a print, and how a team's makespan falls: one process a run.

    python benchmarks/agent_cost.py '{"folder": "…", "part": "cost", "seed": 0, "seconds": 0}'

The print is a pack, as a launcher hands it to its agents (`agents/planners/pack.py`), so
memory is what an agent needs and not what reading G-code takes. Called by `team_growth.py`. All
seconds are processor time; kernels are compiled, or loaded, before.
"""

from __future__ import annotations

import json
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from team_run import judgement

import agents.networks.zenoh_transport  # noqa: F401 - an agent has it loaded
from agents.messages.codec import encode as packed
from agents.messages.kinds import Beat, Envelope, Message
from agents.planners.pack import read_pack
from agents.planners.team_planner import DecMctsPlanner
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.dec_mcts.parameters import Parameters
from decmcts.team.dec_mcts.rounds import plan_in_turn
from decmcts.team.dec_mcts.warm_up import compile_rounds
from decmcts.team.engine.plans import encode
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.resolve import resolve
from decmcts.team.schedule.joint_plan import schedule

POLICIES = 8  # joint orders of default plans that are timed
SHARES, JOINTS, BEATS = 20.0, 1.0, 10.0  # messages a second at most, see docs/protocol.md
Figures = dict[str, Any]
T = TypeVar("T")


def timed(work: Callable[[], T]) -> tuple[T, float]:
    """Return what `work` returns and the processor time it took."""
    began = time.process_time()
    done = work()
    return done, time.process_time() - began


def cost(problem: TeamProblem, build_s: float, seed: int) -> Figures:
    """Return what building, a joint order, a round, an exact plan and messages cost."""
    heads = range(len(problem.machine.heads))

    def order(policy: int) -> Any:
        plans = {r: encode(policy, problem.n_macros) for r in heads}
        return resolve(problem, plans, heads)

    order(0)  # loads the engine
    orders = [timed(partial(order, k)) for k in range(POLICIES)]
    best = min((found for found, _ in orders), key=lambda found: found.makespan_s)

    def exact() -> Any:
        return schedule(problem.job, problem.machine, problem.graph, best.toolpaths)

    exact()
    return {
        "build_s": round(build_s, 4),
        "order_s": round(statistics.median(seconds for _, seconds in orders), 5),
        "schedule_s": round(timed(exact)[1], 3),
        **of_round(problem, seed),
    }


def of_round(problem: TeamProblem, seed: int) -> Figures:
    """Return seconds and bytes of an agent whose policies are tried: tree, updates, polishing."""
    heads = tuple(range(len(problem.machine.heads)))
    usual = Parameters.for_contours(len(problem.macro))
    planner = DecMctsPlanner(
        problem, 0, seed=seed, parameters=replace(usual, tries=max(1, len(heads)))
    )
    compile_rounds()
    planner.iterate(heads)  # tries the policies
    round_s = timed(lambda: planner.iterate(heads))[1]
    told = {"distribution": 0, "joint": 0}
    a_second = 0.0
    if len(heads) > 1:
        told = {"distribution": size(planner.distribution()),
                "joint": size(planner.best_joint(heads))}  # fmt: skip
        a_second = told["distribution"] * min(SHARES, 1 / round_s)
        a_second += told["joint"] * min(JOINTS, 1 / round_s) + BEATS * size(Beat(150))
    return {
        "round_s": round(round_s, 3),
        "distribution_bytes": told["distribution"],
        "joint_bytes": told["joint"],
        "bytes_per_s": round(a_second),
    }


def most_mib() -> int:
    """Return the most memory this process has held (what `wait4` says holds its parent's too)."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) // 1024 for line in lines if line.startswith("VmHWM"))


def size(message: Message) -> int:
    """Return the bytes of a message as it is put."""
    return len(packed(Envelope(0, time.time_ns() // 1_000_000, 1000, message)))


def search(problem: TeamProblem, seed: int, seconds: float) -> Figures:
    """Let all heads plan in turn, so many seconds a head; tell whenever the best fell."""
    heads = len(problem.machine.heads)
    plan_in_turn(problem, stopping=Stopping(0.0), seed=seed)  # loads its kernels
    history: list[tuple[float, float]] = []
    began = time.process_time()

    def keep(_: int, makespan_s: float) -> None:
        if not history or makespan_s < history[-1][1]:
            at = (time.process_time() - began) / heads
            history.append((round(at, 2), round(makespan_s, 2)))

    found, spent = timed(
        lambda: plan_in_turn(
            problem,
            stopping=Stopping(seconds * heads),
            seed=seed,
            clock=time.process_time,
            progress=keep,
        )
    )
    toolpaths = resolve(problem, found.plans, range(heads)).toolpaths
    plan = schedule(problem.job, problem.machine, problem.graph, toolpaths)
    figures = {"spent_s": round(spent, 1), "history": json.dumps(history)}
    return figures | judgement(problem, plan)


def run(asked: Figures) -> Figures:
    """Make one run on a pack."""
    pack = read_pack(Path(asked["folder"]))

    def build() -> TeamProblem:
        return build_team_problem(pack.job, pack.machine, pack.graph, pack.lags, pack.start)

    build()
    problem, build_s = timed(build)
    if asked["part"] == "cost":
        return {**cost(problem, build_s, asked["seed"]), "agent_mib": most_mib()}
    return search(problem, asked["seed"], asked["seconds"])


if __name__ == "__main__":
    print(json.dumps(run(json.loads(sys.argv[1]))))
