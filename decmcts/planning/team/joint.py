"""What became of the agents, and from the joint order they agreed on to the exact plan.

A plan in which one head prints alone is always made too, and taken if it is faster: heads
that wait for each other may be slower.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial

import numpy as np

from agents.launch import LaunchResult
from agents.launching.status import AgentStatus
from agents.networks.transport import DISTURBS
from decmcts.arrays import Int32s
from decmcts.errors import InputError
from decmcts.planning.events import Note, Report, Step
from decmcts.planning.options import TeamSearch
from decmcts.planning.problem.planned import Planned, document_of
from decmcts.planning.problem.print_problem import PrintProblem
from decmcts.planning.team.cutting import GAIN
from decmcts.planning.worker import begun
from decmcts.print.cut import late_contours
from decmcts.print.lags_kernels import Lags
from decmcts.print.metrics import Metrics, TeamMetrics
from decmcts.print.plan import JointPlan, PlanDocument
from decmcts.print.toolpath import Toolpath
from decmcts.team.bounds.makespan import Bound, makespan_bound
from decmcts.team.engine.alone import one_head_toolpaths
from decmcts.team.engine.plans import StatedOrder
from decmcts.team.schedule.entries import (
    OrderChoices,
    best_entries,
    differ,
    entries_of,
    with_entries,
)
from decmcts.team.schedule.joint_plan import schedule


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a launch of agents came to."""

    result: LaunchResult | None  # None: they came to no plan
    agents: tuple[AgentStatus, ...]  # as they were seen last
    failed: str = ""  # why they came to none
    decided: tuple[tuple[float, ...], ...] = ()  # see `Deciding`

    @property
    def lost(self) -> dict[str, str]:
        """The heads that the plan does without, each with the reason."""
        live = () if self.result is None else self.result.agreement.live
        gone = (a for a in self.agents if a.phase == "lost" and a.head not in live)
        return {agent.name: agent.note for agent in gone}

    @property
    def disturbed(self) -> dict[str, int]:
        """What was dropped that no agent says: how many messages by reason."""
        dropped: Counter[str] = Counter()
        for agent in self.agents:
            dropped.update({k: n for k, n in agent.dropped.items() if k.startswith(DISTURBS)})
        return dict(sorted(dropped.items()))

    @property
    def found_by(self) -> str | None:
        """The head whose agent was the first to know a plan as good as the best of all."""
        known = [(cost, s, a.name) for a in self.agents for s, cost in a.history]
        return min(known)[2] if known and not self.failed else None

    def metrics(self) -> Metrics:
        """Return what a plan states of its agents."""
        return {
            "agents": [_traffic(agent) for agent in self.agents],
            "decided": self.decided,
            "found_by": self.found_by,
            "team": {
                "agreed": not self.failed,
                "failed": self.failed or None,
                "lost": self.lost,
                "again": {a.name: a.again for a in self.agents if a.again},
                "disturbed": self.disturbed,
            },
        }


class Deciding:
    """How heads' distributions over plans sharpen: rows of seconds and each head's entropy.

    An entropy is 1 where all plans are alike, and 0 where one is chosen. At most `MOST` rows are
    kept, evenly spread.
    """

    MOST = 128

    def __init__(self) -> None:
        self._rows: list[tuple[float, ...]] = []
        self._least_s = 0.0  # between two rows

    def take(self, agents: tuple[AgentStatus, ...]) -> None:
        """Keep what the agents state, if enough time has passed."""
        seconds = max((agent.elapsed_s for agent in agents), default=0.0)
        if not seconds or (self._rows and seconds < self._rows[-1][0] + self._least_s):
            return
        self._rows.append((round(seconds, 3), *(round(a.entropy, 4) for a in agents)))
        if len(self._rows) > self.MOST:
            self._rows = self._rows[::2]
            self._least_s = 2.0 * max(self._least_s, seconds / self.MOST)

    @property
    def rows(self) -> tuple[tuple[float, ...], ...]:
        """What was kept."""
        return tuple(self._rows)


def lines_of(team: TeamMetrics) -> list[str]:
    """Return a line for whatever a user should know of the agents, from a plan's metrics."""
    lines = [f"{team['failed']}; one head prints alone"] if team["failed"] else []
    if not team["failed"]:
        lost = team["lost"].items()
        lines += [f"head {name} was lost ({why}); the plan does without it" for name, why in lost]
    for name, why in team["again"].items():
        if team["failed"] or name not in team["lost"]:
            lines.append(f"the agent of head {name} was started again ({why})")
    if counts := team["disturbed"]:
        what = ", ".join(f"{n} × {reason}" for reason, n in counts.items())
        lines.append(f"somebody disturbed the agents; dropped and not heard: {what}")
    return lines


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


BOUND_WAIT_S = 10.0  # at most, once all else is done


@dataclass(frozen=True, slots=True)
class Prepared:
    """What is known before the agents begin to plan."""

    problem: PrintProblem
    before: PlanDocument  # the source's own order, one head
    lags: Lags  # that cooling demands
    orders: OrderChoices  # what orders may choose
    lone_order: Toolpath  # the best order found for one head alone
    lone_plan: JointPlan  # of it, for one head that reaches everything
    entry: Int32s  # (n,) where loops are entered while heads plan
    bound: Future[Bound]  # on the makespan, found beside all else
    start: StatedOrder | None = None  # a joint order to begin with
    whole: Prepared | None = None  # the same of the print before it was cut; None: nothing is cut

    @property
    def bound_s(self) -> float:
        """The bound on the makespan as far as it is known; 0 while it is not."""
        return self.bound.result().bound_s if self.bound.done() else 0.0

    def schedule(self, toolpaths: Sequence[Toolpath]) -> JointPlan:
        """Return the exact plan of these toolpaths, one a head."""
        problem = self.problem
        return schedule(problem.job, problem.machine, problem.graph, toolpaths, lags=self.lags)


def plan_alone(ready: Prepared, live: Sequence[int]) -> PlanDocument:
    """Schedule the lone order for one of the live heads; others print what it does not reach."""
    problem = ready.problem
    paths = one_head_toolpaths(problem.job, problem.machine, ready.lone_order, live=live)
    shared = "one head" if sum(len(path) > 0 for path in paths) < 2 else "one order"
    try:
        plan = ready.schedule(paths)
    except InputError:  # entered elsewhere, a loop may be where another head cannot pass
        plan = ready.schedule(with_entries(paths, np.zeros(len(problem.job.contours), np.int32)))
    return document_of(problem, plan, {"planner": f"local, {shared}"})


def sweep_plan(ready: Prepared) -> JointPlan | None:
    """Return the exact plan of the sweep that agents begin with; None: it cannot be printed."""
    if ready.start is None:
        return None
    heads = len(ready.problem.machine.heads)
    try:
        return ready.schedule(with_entries(ready.start.toolpaths(heads), ready.entry))
    except InputError:
        return None


def _in_time(
    ready: Prepared, joint: JointPlan | None, live: int, report: Report
) -> JointPlan | None:
    """Return a plan whose welds keep their limit: the one agreed on, else the sweep's, if any."""
    limit_s, contours = ready.problem.weld_limit_s, ready.problem.job.contours
    if limit_s is None or joint is None or not late_contours(contours, joint, limit_s).any():
        return joint
    if live < len(ready.problem.machine.heads):
        return None
    report(Note(f"what was agreed has welds older than {limit_s:g} s: the sweep is printed"))
    return sweep_plan(ready)


def best_of(
    ready: Prepared, outcome: Outcome, search: TeamSearch, report: Report
) -> tuple[Prepared, PlanDocument]:
    """Return the exact plan of what was agreed, or of one head alone where that is faster.

    Also which print it is of: one head alone prints its contours whole. So it does where cuts gain
    next to nothing.
    """
    problem, orders, result = ready.problem, ready.orders, outcome.result
    agreement = None if result is None else result.agreement
    heads = range(len(problem.machine.heads)) if agreement is None else agreement.live
    whole = ready.whole or ready
    yardstick = begun(partial(plan_alone, whole, heads))
    joint = None if result is None else _joint(ready, result, report)
    joint = _in_time(ready, joint, len(heads), report)
    if not yardstick.done():
        report(Step("safe travels and times of one head alone"))
    alone = yardstick.result()
    extra: Metrics = {
        "planner": search.name,
        "freedom": orders.freedom,
        **({"seam": orders.seam} if orders.freedom == "seam" else {}),
        "objective": orders.objective,
        "seed": search.seed,
        "time_limit_s": search.time_limit_s,
        "parameters": dict(search.parameters),
        "agreed_digest": "" if agreement is None else agreement.digest,
        "live_heads": list(heads),
        "one_head_s": whole.lone_plan.makespan_s,
        **outcome.metrics(),
    }
    worth = 1.0 if ready.whole is None else GAIN
    if joint is not None and joint.makespan_s <= worth * alone.metrics["makespan_s"]:
        return ready, document_of(problem, joint, extra)
    return whole, dataclasses.replace(alone, metrics={**extra, **alone.metrics})


def with_bound(
    planned: Planned, bound: Future[Bound], report: Report, *, wait_s: float = BOUND_WAIT_S
) -> Planned:
    """Return a judged plan that states the proven bound.

    Where that is not found in time it is one that counts neither travel nor the rail's room.
    """
    if not bound.done():
        report(Step("a bound on the makespan"))
    try:
        found = bound.result(wait_s)
    except TimeoutError:
        given = planned.problem
        orders = OrderChoices(given.rules.freedom.value, given.rules.seam.value)
        found = makespan_bound(
            given.job, given.machine, given.graph, entries=entries_of(given.job, orders),
            travel=False, rail=False,
        )  # fmt: skip
        report(Note(f"the sharper bound was not found {wait_s:.0f} s after the plan: a simple one"))
    metrics: Metrics = {**planned.after.metrics, "bound": dataclasses.asdict(found)}
    return dataclasses.replace(planned, after=dataclasses.replace(planned.after, metrics=metrics))


def _joint(ready: Prepared, result: LaunchResult, report: Report) -> JointPlan | None:
    """Return the exact plan of what was agreed, with the entries of loops for which it ends first.

    None where no such plan exists because heads enter loops elsewhere than as sliced: then one
    may stand where another cannot pass.
    """
    problem = ready.problem
    agreed = with_entries(result.toolpaths, ready.entry)
    report(Step("what other entries of loops save"))
    moved = best_entries(
        problem.job, problem.machine, problem.graph, agreed, ready.orders, ready.lags
    )
    report(Step("safe travels, times and order across heads"))
    plans = []
    for paths in (agreed, moved) if differ(agreed, moved) else (agreed,):
        try:
            plans.append(ready.schedule(paths))
        except InputError as error:
            if not ready.entry.any() and not plans:  # as sliced: these heads cannot print it at all
                raise
            report(Note(f"other entries of loops: {error.what}"))
    return min(plans, key=lambda plan: plan.makespan_s, default=None)
