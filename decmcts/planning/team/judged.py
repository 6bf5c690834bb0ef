"""The joint plan and its heads' files judged, two things at once on large prints.

A worker (`decmcts.planning.worker`) judges the plan and then files of heads, from the smallest on;
this process writes and judges files from the largest on.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from decmcts.formats.files.atomic import draft_folder
from decmcts.planning.compiling.parts import PRINT, TEAM, is_compiled
from decmcts.planning.events import Report, Step, unheard
from decmcts.planning.problem.own_tools import for_the_judge
from decmcts.planning.problem.planned import Planned, require_passed
from decmcts.planning.problem.print_problem import PrintProblem
from decmcts.planning.team.beside import begun
from decmcts.planning.worker import Worker, worker
from decmcts.planning.writing.heads import drafting, judged_by, judged_texts
from decmcts.print.job import PrintJob
from decmcts.print.plan import PlanDocument
from sim.faults import Verdict
from sim.verify import verify_plan

BESIDE_FROM = 5_000
"""Contours; fewer are judged sooner than another process has loaded."""

Check = Callable[..., Any]
"""A piece of work; takes a keyword `report`."""

FILES = Path("the G-code of all heads")  # as messages call it


@contextmanager
def judge_beside(problem: PrintProblem, *, writes: bool) -> Iterator[Worker | None]:
    """Start a worker that judges beside this process; None where that is not worth it.

    It is not where kernels are still being compiled: each process would compile them.
    """
    large = len(problem.job.contours) >= BESIDE_FROM
    if not (writes and large and is_compiled(TEAM) and is_compiled(PRINT)):
        yield None
        return
    with worker(__name__) as beside:
        yield beside


def judged(planned: Planned, beside: Worker | None, *, writes: bool, report: Report) -> Planned:
    """Return a plan that passed the judge; with `writes` its heads' files too, with their text.

    Raises
    ------
    VerificationError
        When the judge refuses the plan, or a file.
    """
    started, problem, after = time.perf_counter(), planned.problem, planned.after
    with draft_folder() as folder:
        heads = after.plan.heads if writes else ()
        drafts = [folder / f"{actions.head}.gcode" for actions in heads]
        by_size = sorted(range(len(heads)), key=lambda h: (len(heads[h].path), -h))
        given = for_the_judge(problem)
        judge = judged_by(planned, given) if writes else given
        writing = drafting(planned, drafts, judged=judge) if writes else []
        verifying = ("verifying", partial(_verified, after, given[0]))
        verdict, *walked = shared_out(
            [verifying, *(writing[h] for h in by_size)], beside, report
        )  # fmt: skip
        require_passed(verdict)
        took = {**planned.seconds, "verify": time.perf_counter() - started}
        texts: tuple[bytes, ...] = ()
        if writes:
            in_order = [walked[by_size.index(h)] for h in range(len(heads))]
            texts = judged_texts(planned, drafts, in_order, FILES, report, judged=judge)
    return replace(planned, verdict=verdict, seconds=took, head_files=texts)


def _verified(after: PlanDocument, job: PrintJob, *, report: Report) -> Verdict:
    report(Step("verifying"))
    return verify_plan(after, source=job)


def shared_out(
    works: Sequence[tuple[str, Check]], beside: Worker | None, report: Report
) -> list[Any]:  # fmt: skip
    """Do named pieces of work, `beside` from the first on and here from the last; return all.

    Whichever process is free takes the next. All is done here, in turn, where there is no other.
    """
    if beside is None:
        return [work(report=report) for _, work in works]
    left, found = deque(range(len(works))), dict[int, Any]()

    def elsewhere(process: Worker) -> None:
        with suppress(IndexError):
            while True:
                k = left.popleft()
                found[k] = process.call(partial(works[k][1], report=unheard)).result()

    other = begun(partial(elsewhere, beside))
    with suppress(IndexError):
        while True:
            k = left.pop()
            found[k] = works[k][1](report=report)
    if missing := set(range(len(works))) - found.keys():
        report(Step(f"{works[min(missing)][0]}, in a process beside"))
    other.result()
    return [found[k] for k in range(len(works))]
