"""Several files, one a head, verified together: `decmcts verify STEM_*.gcode`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from decmcts.errors import InputError
from decmcts.formats.gcode import GcodeDocument, read_gcode
from decmcts.formats.gcode.text.source_text import load_text
from decmcts.formats.machines.machine_file import load_machine
from decmcts.formats.mesh import is_mesh
from decmcts.planning.problem.made_from import as_planned_anew
from decmcts.planning.problem.print_problem import parked_above
from decmcts.planning.problem.source import Source
from decmcts.planning.verifying.held import Held
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.plan import OrderRules, PlanDocument
from sim.content.pieces import epochs_of_source, parted_source
from sim.content.same_print import is_other_print
from sim.faults import Fault, FaultKind, Verdict, listed
from sim.files.phases import in_phases
from sim.files.tower import read_without_tower
from sim.heads.changes import as_planned, without_changes
from sim.heads.file import HeadFile, header_of, is_cut, read_head_file
from sim.heads.plan import plan_of_files
from sim.heads.together import verify_heads_on
from sim.rules.order_rules import usual_rules
from sim.verify import verify_plan

WITHOUT_PLAN = (
    "no plan was given: files do not say what rules their order was held to, nor what must cool; "
    "name the rules as for `launch`, or give --plan"
)


def ordered(paths: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """Return the files in the order that their headers state, and the head of each.

    Raises
    ------
    InputError
        When one of them is not the file of one head of several.
    """
    headers = [(header_of(load_text(path)), path) for path in paths]
    for (head, _), path in headers:
        if not head:
            raise InputError(
                "this is not the file of one head of several",
                path=path,
                advice="name all files of one `launch` and nothing else",
            )
    headers.sort(key=lambda header: header[0][1])
    return [path for _, path in headers], [head for (head, _), _ in headers]


def read_as_asked(
    source: Path, plate: int | None, *, without_tower: bool
) -> tuple[PrintJob, GcodeDocument]:
    """Read a source; without its wipe tower if that was to be left out."""
    job, document = read_gcode(source, plate)
    return read_without_tower(document, plate) if without_tower else (job, document)


def read_as_planned(
    plan: PlanDocument, source: Path, plate: int | None, *, without_tower: bool
) -> Source:
    """Read a source as asked, in the order its plan was made of.

    What is read stands in a folder that is gone with the source that is returned.
    """
    job, document = read_as_asked(source, plate, without_tower=without_tower)
    return as_planned_anew(plan, Source(source, job, document, plan.machine, plate=plate))


def judge_heads(paths: Sequence[Path], source: Source, plan: PlanDocument) -> Verdict:
    """Verify the files of all heads against the plan and the source they were made from."""
    cut = "none" if plan.rules is None else plan.rules.cut
    job, document = as_planned(
        epochs_of_source(plan.contours), plan.machine, source.job, source.document
    )
    parted = parted_source(plan.contours, job, cut)
    if parted.faults:
        return Verdict(parted.faults)
    job, document = parted.job, parted.text(document)
    files, named = ordered(paths)
    faults = misnamed(files, named, plan.machine)
    verdict = verify_heads_on(plan.machine, files, plan.plan, job, document)
    return Verdict((*faults, *verdict.faults), verdict.counts)


def judge_heads_alone(
    paths: Sequence[Path], source: Path, machine: str | Machine | None, held: Held, *,
    seed: int, trials: int, plate: int | None = None, without_tower: bool = False,
) -> Verdict:  # fmt: skip
    """Verify the files of all heads by what they do on the machine, without their plan.

    The order is held to the default rules, with those that `held` names in their place.
    """
    job, document = read_as_asked(source, plate, without_tower=without_tower)
    chosen = machine if isinstance(machine, Machine) else load_machine(machine or "dual-gantry")
    chosen = parked_above(replace(chosen, limits=chosen.limits.under(job.limits)), job.contours)
    paths, named = ordered(paths)
    files = [read_head_file(path, chosen.words) for path in paths]
    refuse_cut(files)
    names = [head.name for head in chosen.heads]
    faults = misnamed(paths, named, chosen)
    if sorted(file.name for file in files) != sorted(names):
        there, due = ", ".join(file.name for file in files), ", ".join(names)
        text = f"there are files of heads {there}; machine {chosen.name} has {due}"
        text += "" if machine else " (another is named with --machine)"
        return Verdict((*faults, Fault(FaultKind.MISSING, text)))
    rules = held.over(usual_rules(chosen)) if held.any_rule else None
    judge = partial(_judge_alone, files, machine=chosen, rules=rules, seed=seed, trials=trials)
    found = judge(source=(job, document))
    for taken in () if found.ok else _taken_otherwise(job, document):
        found = min(judge(source=taken), found, key=lambda verdict: len(verdict.faults))
    return replace(found, faults=(*faults, *found.faults))


def _taken_otherwise(
    job: PrintJob, document: GcodeDocument
) -> Iterator[tuple[PrintJob, GcodeDocument]]:
    """Yield other ways in which a source may have been taken."""
    if (phases := in_phases(job, document)) is not None:
        yield phases
    if (free := without_changes(job, document)) is not None:
        yield free


def _judge_alone(
    files: Sequence[HeadFile], *, source: tuple[PrintJob, GcodeDocument],
    machine: Machine, rules: OrderRules | None, seed: int, trials: int,
) -> Verdict:  # fmt: skip
    """Verify files of heads against one reading of their source."""
    job, document = source
    plan, altered = plan_of_files(files, job, machine)
    if is_other_print(altered):
        return Verdict(tuple(altered))
    # Its times are made up. How near signals are is judged by the files' own lines, below.
    made_up = replace(plan, machine=replace(plan.machine, signal_interval_s=0.0))
    verdict = verify_plan(made_up, source=job, rules=rules, trials=trials, seed=seed)
    more = verify_heads_on(machine, files, plan.plan, job, document, read=True)
    every = (*altered, *verdict.faults, *more.faults)
    checked = (*verdict.checked[:1], WITHOUT_PLAN)
    counts = {**verdict.counts, **more.counts}
    return replace(verdict, faults=every, counts=counts, checked=checked)


def refuse_cut(files: Sequence[HeadFile]) -> None:
    """Raise InputError for files of a cut print: which pieces they print only a plan says."""
    for file in files:
        if is_cut(file.lines.text):
            raise InputError(
                "contours are cut in it, and which are pieces of what only the plan says",
                path=file.path,
                advice="add --plan plan.json, as `launch --plan` writes it",
            )


def misnamed(paths: Sequence[Path], named: Sequence[str], machine: Machine) -> list[Fault]:
    """Return a fault for each file named after another head: it would go to its controller."""
    lines = []
    for path, name in zip(paths, named, strict=True):
        stem = path.name.removesuffix(".gz").removesuffix(".gcode")
        ends = [head.name for head in machine.heads if stem.endswith(f"_{head.name}")]
        if ends and name not in ends:
            lines.append(f"{path.name} is the file of head {name}")
    return listed(FaultKind.COMMAND, lines)


def source_of(source: Path | None) -> Path:
    """Return the source, which files of several heads cannot be judged without."""
    if source is None:
        raise InputError("G-code files need their source", advice="add --source IN.gcode")
    refuse_mesh(source, "verify the plan.json of `launch --plan`")
    return source


def refuse_mesh(source: Path, advice: str) -> None:
    """Raise InputError for a source that holds no extrusions to compare with."""
    if is_mesh(source):
        raise InputError(
            "what was made of a mesh cannot be compared with it", path=source, advice=advice
        )
