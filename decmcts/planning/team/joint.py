"""From what agents agreed on to the plan that is written: the exact schedule, and the best of it.

One head alone is always tried too: heads that wait for each other may be slower.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from agents.launch import LaunchResult
from agents.supervisor import AgentStatus
from decmcts._kernels.engine.lags import Lags
from decmcts.errors import InputError
from decmcts.planning.events import Note, Report
from decmcts.planning.options import TeamSearch
from decmcts.planning.problem.planned import document_of
from decmcts.planning.problem.print_problem import PrintProblem
from decmcts.print.plan import JointPlan, PlanDocument
from decmcts.print.toolpath import Toolpath
from decmcts.team.bounds.makespan import Bound
from decmcts.team.engine.alone import lone_machine, one_head_toolpaths
from decmcts.team.schedule.entries import Orders, best_entries, with_entries
from decmcts.team.schedule.joint_plan import schedule


def plan_alone(
    problem: PrintProblem, lags: Lags, order: Toolpath, live: Sequence[int]
) -> PlanDocument:
    """Schedule one order for one of the live heads, the others parked where possible."""
    paths = one_head_toolpaths(problem.job, problem.machine, order, live=live)
    plan = schedule(problem.job, problem.machine, problem.graph, paths, lags=lags)
    shared = "one head" if sum(len(path) > 0 for path in paths) < 2 else "one order"
    return document_of(problem, plan, {"planner": f"local, {shared}"})


def best_of(
    problem: PrintProblem,
    lags: Lags,
    result: LaunchResult | None,
    order: Toolpath,
    entry: NDArray[np.int32],
    bound: Bound,
    asked: TeamSearch,
    orders: Orders,
    report: Report,
) -> PlanDocument:
    """Schedule what was agreed, or one head alone where that is faster.

    `entry` is where loops were entered when it was agreed, (n,).
    """
    agreement = None if result is None else result.agreement
    heads = range(len(problem.machine.heads)) if agreement is None else agreement.live
    alone = plan_alone(problem, lags, order, heads)
    lone = schedule(problem.job, lone_machine(problem.machine), problem.graph, [order], lags=lags)
    extra: dict[str, object] = {
        "planner": "dec-mcts",
        **_said(orders),
        "seed": asked.seed,
        "time_limit_s": asked.time_limit_s,
        "parameters": dict(asked.parameters),
        "agreed_digest": "" if agreement is None else agreement.digest,
        "live_heads": list(heads),
        "one_head_s": lone.makespan_s,
        "bound": dataclasses.asdict(bound),
        "agents": [] if agreement is None else [_traffic(agent) for agent in agreement.agents],
    }
    if result is not None:
        joint = _joint(problem, lags, result, entry, orders, report)
        if joint is not None and joint.makespan_s <= alone.metrics["makespan_s"]:
            return document_of(problem, joint, extra)
    return dataclasses.replace(alone, metrics={**extra, **alone.metrics})


def _joint(
    problem: PrintProblem,
    lags: Lags,
    result: LaunchResult,
    entry: NDArray[np.int32],
    orders: Orders,
    report: Report,
) -> JointPlan | None:
    """Return the exact plan of what was agreed: as it is, or with other entries if it ends first.

    None where one shuts another in that enters loops elsewhere than as sliced.
    """
    job, machine, graph = problem.job, problem.machine, problem.graph
    agreed = with_entries(result.toolpaths, entry)
    plans = []
    for paths in (agreed, best_entries(job, machine, graph, agreed, orders, lags)):
        try:
            plans.append(schedule(job, machine, graph, paths, lags=lags))
        except InputError as error:
            if not entry.any() and not plans:  # then these heads cannot print it at all
                raise
            report(Note(f"other entries of loops: {error.what}"))
    return min(plans, key=lambda plan: plan.makespan_s, default=None)


def _said(orders: Orders) -> dict[str, str]:
    """Return what orders are free to do, as `plan` says it."""
    seam = {"seam": orders.seam} if orders.freedom == "seam" else {}
    return {"freedom": orders.freedom, **seam, "objective": orders.objective}


def _traffic(agent: AgentStatus) -> dict[str, object]:
    return {
        "head": agent.name,
        "rounds": agent.rounds,
        "sent": sum(agent.sent.values()),
        "sent_bytes": sum(agent.sent_bytes.values()),
        "received": sum(agent.received.values()),
        "received_bytes": sum(agent.received_bytes.values()),
        "dropped": sum(agent.dropped.values()),
        "agreeing_s": agent.agreeing_s,
    }
