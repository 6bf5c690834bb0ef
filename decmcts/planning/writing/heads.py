"""The G-code of several heads, a file each, judged together before any of them is written.

Of large prints two things are judged at once: a worker judges the plan and then files of heads,
from the smallest on; this process writes and judges files from the largest on.
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

from decmcts.errors import InputError
from decmcts.formats.files.atomic import draft_folder, write_all
from decmcts.formats.gcode import GcodeDocument, write_head_gcode
from decmcts.formats.gcode.text.source_text import PACKED_SUFFIXES
from decmcts.formats.gcode.writing.sync_points import SyncPoints, number_sync_points
from decmcts.planning.compiling import PRINT, TEAM, is_compiled
from decmcts.planning.events import Report, Step, unheard
from decmcts.planning.problem.own_tools import for_the_judge
from decmcts.planning.problem.planned import Planned, require_passed
from decmcts.planning.problem.print_problem import PrintProblem
from decmcts.planning.worker import Worker, begun, worker
from decmcts.planning.writing.lines import header_lines
from decmcts.planning.writing.places import STDOUT, require_sound
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.plan import JointPlan, PlanDocument
from sim.content.pieces import parted_source
from sim.content.same_print import is_other_print
from sim.faults import Verdict
from sim.heads.file import read_head_file
from sim.heads.one_file import Walked, walk_file
from sim.heads.plan import plan_of_files
from sim.heads.together import judge_together, unreadable, verify_heads
from sim.verify import verify_plan

BESIDE_FROM = 5_000  # contours; fewer are judged sooner than another process has loaded
FILES = Path("the G-code of all heads")  # as messages call it
Check = Callable[..., Any]  # a piece of work; takes a keyword `report`


def stem_of(output: Path) -> Path:
    """Return what the names of the heads' files begin with: the output, without `.gcode`.

    Raises InputError for standard output, for folders, and for what G-code is packed in.
    """
    if output == STDOUT:
        raise InputError(
            "several files do not go to standard output", advice="name a stem, such as -o part"
        )
    if not output.name or output.is_dir():
        raise InputError("the output is a folder", path=output, advice="name a stem in it")
    if output.suffix.lower() in PACKED_SUFFIXES:
        raise InputError(
            f"the files of several heads are not written as {output.suffix.lower()}",
            path=output,
            advice="name a stem, such as -o part",
        )
    return output.with_suffix("") if output.suffix.lower() == ".gcode" else output


def head_files(stem: Path, machine: Machine) -> list[Path]:
    """Return the names of the files of the machine's heads, `STEM_HEAD.gcode`."""
    return [_head_file(stem, head.name) for head in machine.heads]


def _head_file(stem: Path, head: str) -> Path:
    return stem.with_name(f"{stem.name}_{head}.gcode")


def write_heads(
    planned: Planned,
    stem: Path,
    *,
    write: Callable[..., None] = write_head_gcode,
    report: Report = unheard,
) -> list[Path]:
    """`write` one G-code file per head, `STEM_HEAD.gcode`, all or none; returns the paths.

    Those that were written with the plan are put in place. Else the report is told what is written,
    read back and judged. Raises VerificationError when the files, read back, are not the verified
    plan, InputError when one of them cannot be written; then none is.
    """
    paths = [_head_file(stem, actions.head) for actions in planned.after.plan.heads]
    texts = planned.head_files
    if not texts:
        with draft_folder() as folder:
            drafts = [folder / path.name for path in paths]
            judged = judged_by(planned, for_the_judge(planned.problem))
            works = drafting(planned, drafts, judged=judged, write=write)
            walked = [work(report=report) for _, work in works]
            texts = judged_texts(planned, drafts, walked, stem, report, judged=judged)
    write_all(list(zip(paths, texts, strict=True)))
    return paths


def drafting(
    planned: Planned, drafts: Sequence[Path], *, judged: tuple[PrintJob, GcodeDocument],
    write: Callable[..., None] = write_head_gcode,
) -> list[tuple[str, Callable[..., Walked]]]:  # fmt: skip
    """Return the work of writing each head's draft and walking it along the plan, with its name.

    `judged` is the source as the judge takes it. It can be done in another process.
    """
    problem, plan, machine = planned.problem, planned.after.plan, planned.problem.machine
    apart_s = machine.signal_interval_s if machine.release == "point" else 0.0
    points = number_sync_points(plan, problem.job, machine.release, apart_s)  # once for all heads
    draft = partial(
        _draft, problem.document, problem.job, plan, machine, header_lines(planned), points,
        judged=judged, write=write,
    )  # fmt: skip
    return [
        (f"writing and judging {path.name}", partial(draft, head, path))
        for head, path in enumerate(drafts)
    ]


def judged_by(
    planned: Planned, given: tuple[PrintJob, GcodeDocument]
) -> tuple[PrintJob, GcodeDocument]:
    """Return what files are judged by, from the source: of a cut print the judge's own pieces."""
    job, document = given
    parted = parted_source(planned.after.contours, job, planned.problem.cut.value)
    require_sound(Verdict(parted.faults), planned.problem.path)
    return parted.job, parted.text(document)


def _draft(
    document: GcodeDocument, job: PrintJob, plan: JointPlan, machine: Machine,
    header: Sequence[str], points: SyncPoints, head: int, path: Path, *,
    judged: tuple[PrintJob, GcodeDocument], write: Callable[..., None], report: Report,
) -> Walked:  # fmt: skip
    """Write the draft of one head's file, read it back and walk it along the plan."""
    report(Step(f"writing {path.name}"))
    write(document, job, plan, head, path, machine=machine, header_lines=header, points=points)
    report(Step(f"reading {path.name} back"))
    try:
        file = read_head_file(path, machine.words)
    except InputError as error:
        require_sound(unreadable(error), path)
        raise  # not reached
    report(Step(f"walking the file of head {plan.heads[head].head} along the plan"))
    return walk_file(file, head, plan, *judged, machine)


def judged_texts(
    planned: Planned, drafts: Sequence[Path], walked: Sequence[Walked], stem: Path, report: Report,
    *, judged: tuple[PrintJob, GcodeDocument],
) -> tuple[bytes, ...]:  # fmt: skip
    """Return the text of drafts that do together what the plan says.

    Raises VerificationError when they do not; it names the `stem`.
    """
    problem, machine = planned.problem, planned.problem.machine
    report(Step("what the files' sync points order"))
    verdict = judge_together(walked, planned.after.plan, *judged, machine)
    require_sound(verdict, stem)
    if (given := problem.source.original) is not None:
        report(Step("judging the files by what was given"))
        files = [read_head_file(draft, machine.words) for draft in drafts]
        plan, altered = plan_of_files(files, given.job, machine)
        if not is_other_print(altered):
            verdict = verify_heads(machine, drafts, plan.plan, given.job, given.document, read=True)
            altered = [*altered, *verdict.faults]
        require_sound(Verdict(tuple(altered)), stem)
    return tuple(draft.read_bytes() for draft in drafts)


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

    Raises VerificationError when the judge refuses the plan, or a file.
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
