"""From what agents agreed on to the plan that is written: the exact schedule, and the best of it.

One head alone is always tried too: heads that wait for each other may be slower.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.launch import LaunchResult
from agents.supervisor import AgentStatus
from decmcts._kernels.engine.lags import Lags
from decmcts.cli.console import err
from decmcts.cli.pipeline import Loaded, document_of
from decmcts.errors import InputError
from decmcts.print.plan import JointPlan, PlanDocument
from decmcts.print.toolpath import Toolpath
from decmcts.team.bounds.makespan import Bound
from decmcts.team.engine.alone import lone_machine, one_head_toolpaths
from decmcts.team.schedule.entries import Orders, best_entries, with_entries
from decmcts.team.schedule.joint_plan import schedule


@dataclass(frozen=True, slots=True)
class TeamSearch:
    """What was asked of the heads' search."""

    time_limit_s: float
    seed: int
    parameters: Mapping[str, Any] = field(default_factory=dict)  # those that are set
    record: Path | None = None
    orders: Orders = field(default_factory=Orders)


def plan_alone(loaded: Loaded, lags: Lags, order: Toolpath, live: Sequence[int]) -> PlanDocument:
    """Schedule one order for one of the live heads, the others parked where possible."""
    paths = one_head_toolpaths(loaded.job, loaded.machine, order, live=live)
    plan = schedule(loaded.job, loaded.machine, loaded.graph, paths, lags=lags)
    shared = "one head" if sum(len(path) > 0 for path in paths) < 2 else "one order"
    return document_of(loaded, plan, {"planner": f"local, {shared}"})


def best_of(
    loaded: Loaded,
    lags: Lags,
    result: LaunchResult | None,
    order: Toolpath,
    entry: NDArray[np.int32],
    bound: Bound,
    asked: TeamSearch,
) -> PlanDocument:
    """Schedule what was agreed, or one head alone where that is faster.

    `entry` is where loops were entered when it was agreed, (n,).
    """
    agreement = None if result is None else result.agreement
    heads = range(len(loaded.machine.heads)) if agreement is None else agreement.live
    alone = plan_alone(loaded, lags, order, heads)
    lone = schedule(loaded.job, lone_machine(loaded.machine), loaded.graph, [order], lags=lags)
    extra: dict[str, Any] = {
        "planner": "dec-mcts",
        **_said(asked.orders),
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
        joint = _joint(loaded, lags, result, entry, asked.orders)
        if joint is not None and joint.makespan_s <= alone.metrics["makespan_s"]:
            return document_of(loaded, joint, extra)
    return dataclasses.replace(alone, metrics={**extra, **alone.metrics})


def _joint(
    loaded: Loaded, lags: Lags, result: LaunchResult, entry: NDArray[np.int32], orders: Orders
) -> JointPlan | None:
    """Return the exact plan of what was agreed: as it is, or with other entries if it ends first.

    None where one shuts another in that enters loops elsewhere than as sliced.
    """
    job, machine, graph = loaded.job, loaded.machine, loaded.graph
    agreed = with_entries(result.toolpaths, entry)
    plans = []
    for paths in (agreed, best_entries(job, machine, graph, agreed, orders, lags)):
        try:
            plans.append(schedule(job, machine, graph, paths, lags=lags))
        except InputError as error:
            if not entry.any() and not plans:  # then these heads cannot print it at all
                raise
            err.print(f"other entries of loops: {error.what}", markup=False, soft_wrap=True)
    return min(plans, key=lambda plan: plan.makespan_s, default=None)


def _said(orders: Orders) -> dict[str, str]:
    """Return what orders are free to do, as `plan` says it."""
    seam = {"seam": orders.seam} if orders.freedom == "seam" else {}
    return {"freedom": orders.freedom, **seam, "objective": orders.objective}


def _traffic(agent: AgentStatus) -> dict[str, Any]:
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
