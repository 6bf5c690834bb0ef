"""Plans as documents that can be judged, and the plan that passed the judge."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import VerificationError
from decmcts.formats.gcode.controller.duration import FileTime
from decmcts.planning.events import Report, Step
from decmcts.planning.problem.print_problem import PrintProblem
from decmcts.print.brief import brief
from decmcts.print.cut import cut_metrics, with_welds
from decmcts.print.metrics import Metrics
from decmcts.print.plan import JointPlan, PlanDocument
from decmcts.print.toolpath import Toolpath
from decmcts.team.engine.alone import lone_machine
from decmcts.team.schedule.joint_plan import schedule
from decmcts.team.schedule.metrics import plan_metrics
from decmcts.version import __version__
from sim.faults import Verdict
from sim.verify import verify_plan

History = NDArray[np.float64]
"""(k, 3) seconds, iterations, cost at each improvement; of heads (k, 2) seconds, makespan."""


@dataclass(frozen=True, slots=True)
class Planned:
    """A plan that passed verification, with the source's own order beside it."""

    problem: PrintProblem
    before: PlanDocument
    after: PlanDocument
    verdict: Verdict
    history: History
    seconds: dict[str, float]
    sliced: FileTime | None = None  # the source's file, where it is G-code and was looked at
    own_s: float | None = None  # the source's own order written anew: its whole file, if known
    head_files: tuple[bytes, ...] = ()  # text of the heads' files, judged; none: not written yet

    __repr__ = brief(
        "problem.source.name", "before.plan.makespan_s", "after.plan.makespan_s", "verdict.ok"
    )


def document_of(problem: PrintProblem, plan: JointPlan, extra: Metrics) -> PlanDocument:
    """Wrap a plan with all that is needed to check and draw it."""
    metrics: Metrics = {**plan_metrics(problem.job, plan), **extra, "version": __version__}
    if problem.whole is not None:
        pieces = problem.job.contours
        metrics["cut"] = with_welds(cut_metrics(pieces), pieces, plan)
    if problem.source.original is not None:
        metrics["made_safe"] = True  # so no figure of it is compared with the source's own order
    return PlanDocument(
        problem.digest, problem.machine, problem.job.contours, problem.graph.pairs(), plan, metrics,
        problem.min_layer_time_s,
        replace(
            problem.rules.on(problem.machine),
            cut=problem.cut.value,
            weld_limit_s=problem.weld_limit_s,
        ),
        problem.job.accelerations,
        problem.job.printed,
        problem.job.fenced,
        problem.job.print_with,
    )  # fmt: skip


def source_plan(problem: PrintProblem) -> PlanDocument:
    """Schedule the source's own order, the yardstick every result is compared with.

    Of a machine with several heads the quickest prints it alone, as if it reached everything, and
    no other stood in its way.
    """
    one = len(problem.machine.heads) == 1
    machine = problem.machine if one else lone_machine(problem.machine)
    sliced = Toolpath.as_sliced(len(problem.job.contours))
    plan = schedule(problem.job, machine, problem.graph, [sliced])
    extra: Metrics = {"planner": "slicer", "objective": "travel", "freedom": "fixed", "seed": 0}
    document = document_of(replace(problem, machine=machine), plan, extra)
    return document if one else replace(document, fenced=None)


def check(
    problem: PrintProblem,
    before: PlanDocument,
    after: PlanDocument,
    history: History,
    seconds: Mapping[str, float],
    report: Report,
) -> Planned:
    """Verify a plan with the independent judge; raises VerificationError when it fails."""
    report(Step("verifying"))
    started = time.perf_counter()
    verdict = verify_plan(after, source=problem.job)
    took = {**seconds, "verify": time.perf_counter() - started}
    require_passed(verdict)
    return Planned(problem, before, after, verdict, history, took)


def require_passed(verdict: Verdict) -> None:
    """Raise VerificationError for a plan with faults."""
    if verdict.faults:
        raise VerificationError(
            f"the plan failed verification with {len(verdict.faults)} faults "
            f"and was not written: {verdict.shown}"
        )
