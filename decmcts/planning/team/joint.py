"""From the joint order that agents agreed on to the exact plan that is written.

A plan in which one head prints alone is always made too, and taken if it is faster: heads
that wait for each other may be slower.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from agents.launch import LaunchResult
from decmcts.errors import InputError
from decmcts.planning.events import Note, Report, Step
from decmcts.planning.options import TeamSearch
from decmcts.planning.problem.planned import Planned, document_of
from decmcts.planning.problem.print_problem import PrintProblem
from decmcts.planning.team.beside import begun
from decmcts.planning.team.cutting import GAIN
from decmcts.planning.team.outcome import Outcome
from decmcts.print.cut import late_contours
from decmcts.print.lags_kernels import Lags
from decmcts.print.metrics import Metrics
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
    entry: NDArray[np.int32]  # (n,) where loops are entered while heads plan
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
    problem, result = ready.problem, outcome.result
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
        **_freedom_metrics(ready.orders),
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


def _freedom_metrics(orders: OrderChoices) -> Metrics:
    """Return what a plan's metrics say of its freedom and objective."""
    stated: Metrics = {"freedom": orders.freedom}
    if orders.freedom == "seam":
        stated["seam"] = orders.seam
    return {**stated, "objective": orders.objective}
