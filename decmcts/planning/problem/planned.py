"""Plans as documents that can be judged, and the plan that passed the judge."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from decmcts.arrays import Floats
from decmcts.errors import VerificationError
from decmcts.formats.gcode.controller.duration import FileTime
from decmcts.planning.events import Report, Step
from decmcts.planning.problem.print_problem import PrintProblem
from decmcts.print.brief import brief
from decmcts.print.contours import Contours
from decmcts.print.cut import cut_metrics, with_welds
from decmcts.print.metrics import Metrics
from decmcts.print.plan import ActionKind, HeadActions, JointPlan, PlanDocument
from decmcts.print.toolpath import Toolpath
from decmcts.team.engine.alone import lone_machine
from decmcts.team.schedule.joint_plan import schedule
from decmcts.team.schedule.metrics import plan_metrics
from decmcts.version import __version__
from sim.faults import Verdict
from sim.verify import verify_plan

History = Floats
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


def before_by_pieces(before: PlanDocument, after: PlanDocument) -> PlanDocument:
    """Return the source's own order in the pieces of a cut print.

    Each contour that is cut is printed piece by piece, in the time it takes whole: what lies of it
    in one strip at once, though the source comes back to the strip.
    """
    pieces = after.contours
    if pieces.of is None or before.contours.of is not None:
        return before
    heads = tuple(_by_pieces(head, pieces) for head in before.plan.heads)
    return replace(before, contours=pieces, plan=JointPlan(heads), acceleration=None)


def _by_pieces(actions: HeadActions, pieces: Contours) -> HeadActions:
    """Return the actions of a head that waits for no other, with a print for each piece."""
    count, share = np.bincount(pieces.sources), _shares(pieces)
    first = np.cumsum(count) - count
    prints = actions.kind == ActionKind.PRINT
    parts = np.where(prints, count[np.where(prints, actions.contour, 0)], 1)
    row = np.repeat(np.arange(len(actions)), parts)
    within = np.arange(len(row)) - np.repeat(np.cumsum(parts) - parts, parts)
    piece = np.where(prints[row], first[actions.contour[row]] + within, -1)
    begin_s, end_s = actions.begin_s[row], actions.end_s[row]
    cut = parts[row] > 1
    takes = (end_s - begin_s)[cut]
    end_s[cut] = begin_s[cut] + takes * share[piece[cut], 1]
    begin_s[cut] += takes * share[piece[cut], 0]
    paths = [
        pieces.polyline(int(p)) if of_cut else actions.action_path(int(k))
        for k, p, of_cut in zip(row, piece, cut, strict=True)
    ]
    offsets = np.concatenate([[0], np.cumsum([len(path) for path in paths])]).astype(np.int64)
    return replace(
        actions, kind=actions.kind[row], contour=piece.astype(np.int32),
        reversed=actions.reversed[row], entry=actions.entry[row], path_offsets=offsets,
        path=np.concatenate([np.empty((0, 3)), *paths]), begin_s=begin_s, end_s=end_s,
        after_offsets=np.zeros(len(row) + 1, np.int64), after_head=actions.after_head[:0],
        after_action=actions.after_action[:0], after_point=actions.after_point[:0],
        after_lag_s=actions.after_lag_s[:0],
    )  # fmt: skip


def _shares(pieces: Contours) -> Floats:
    """Return from which to which share of its contour's printing each piece is printed, (n, 2)."""
    step = np.linalg.norm(np.diff(pieces.points, axis=0, prepend=pieces.points[:1]), axis=1)
    step[pieces.extrusion == 0.0] = 0.0
    length = np.add.reduceat(step, pieces.offsets[:-1])
    begins = np.unique(pieces.sources, return_index=True)[1]
    done = np.cumsum(length)
    before = np.repeat((done - length)[begins], np.diff(np.append(begins, len(pieces))))
    whole = np.repeat(np.add.reduceat(length, begins), np.diff(np.append(begins, len(pieces))))
    whole = np.maximum(whole, 1e-12)[:, None]
    return np.asarray(np.column_stack([done - length - before, done - before]) / whole)
