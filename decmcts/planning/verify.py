"""Judge a plan or finished files again, by the rules they state or by others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from decmcts.arguments import checked
from decmcts.errors import InputError
from decmcts.feasibility.digest import problem_digest
from decmcts.feasibility.graph import DependencyGraph
from decmcts.formats.files.reading import read_bytes
from decmcts.formats.gcode import GcodeDocument, read_gcode
from decmcts.formats.gcode.text.source_text import has_plates, line_with_number, load_text
from decmcts.formats.machines.machine_file import load_machine
from decmcts.formats.mesh import is_mesh
from decmcts.formats.plans.plan_json import is_plan, read_plan
from decmcts.planning.events import Note, Report, Step, unheard
from decmcts.planning.options import AS_STATED, Held
from decmcts.planning.problem.made_from import as_planned_anew
from decmcts.planning.problem.own_tools import one_tool_each
from decmcts.planning.problem.print_problem import parked_above
from decmcts.planning.problem.source import Source, machine_for
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.plan import OrderRules, PlanDocument
from sim.content.pieces import epochs_of_source, parted_source
from sim.content.same_print import is_other_print
from sim.faults import Fault, FaultKind, Verdict, listed
from sim.files.temperatures import in_phases
from sim.files.written import check_line_numbers, read_without_tower, verify_same, verify_written
from sim.heads.changes import as_planned, without_changes
from sim.heads.file import HeadFile, header_of, is_cut, read_head_file
from sim.heads.plan import plan_of_files
from sim.heads.together import verify_heads
from sim.rules.cooling import check_stated
from sim.rules.order_rules import usual_rules
from sim.verify import verify_plan


@checked
def verify(
    result: str | Path | Sequence[str | Path],
    source: str | Path | None = None,
    machine: str | Machine | None = None,
    *,
    plan: str | Path | None = None,
    plate: int | None = None,
    held: Held = AS_STATED,
    trials: int = 3,
    seed: int = 0,
    report: Report = unheard,
) -> Verdict:
    """Replay a plan or finished G-code, by logic that shares nothing with the planners'.

    Parameters
    ----------
    result : str | Path | Sequence[str | Path]
        A plan.json, a G-code file, or the files of all heads.
    source : str | Path | None
        The G-code it was made from; a plan.json can do without.
    machine : str | Machine | None
        The printer; None: the one the plan or the source names.
    plan : str | Path | None
        Of files of several heads: the plan.json they were made from.
    plate : int | None
        Of a .gcode.3mf, result or source: whose G-code; None: the only one's that has any.
    held : Held
        Rules that replace those a plan states.
    trials : int
        Number of random timings in which a joint plan is replayed.
    seed : int
        Seed of these timings.
    report : Report
        Told what is done.

    Returns
    -------
    Verdict
        All faults found; `ok` if there are none.

    Raises
    ------
    InputError
        When a file cannot be read, or the source or machine it must be compared with is missing.

    Examples
    --------
    >>> from decmcts import sample_path, verify
    >>> nuts = sample_path("four_nuts.gcode.gz")
    >>> verify(nuts, source=nuts, machine="mk4s").ok
    True
    """
    several = [result] if isinstance(result, str | Path) else result
    files = [Path(one) for one in several]
    given, made_from = (None if one is None else Path(one) for one in (source, plan))
    if not files:
        raise InputError("no file to verify")
    for path in files:
        if not path.exists():
            raise InputError("no such file", path=path)
    report(Step(f"verifying {', '.join(path.name for path in files)}"))
    asked = Judging(machine, held, seed, trials, plate)
    named = files if given is None else [*files, given]
    if plate is not None and not any(map(has_plates, named)):
        raise InputError(f"no plate {plate}: only a .gcode.3mf has plates", advice="leave it out")
    if len(files) > 1 or made_from is not None or is_whole_team(files[0], plate):
        return judge_several(files, given, made_from, asked)
    return judge(files[0], given, asked, report)


WITHOUT_PLAN = (
    "no plan was given: files do not say what rules their order was held to, nor what must cool; "
    "name the rules as for `launch`, or give --plan"
)


class Judging(NamedTuple):
    """How to judge, as `decmcts.verify` has it."""

    machine: str | Machine | None
    held: Held
    seed: int
    trials: int
    plate: int | None


def judge_several(
    results: list[Path], source: Path | None, plan: Path | None, asked: Judging
) -> Verdict:
    """Verify the files of all heads together, with the plan they were made from or without."""
    if source is None:
        raise InputError("G-code files need their source", advice="add --source IN.gcode")
    refuse_mesh(source, "verify the plan.json of `launch --plan`")
    if plan is None:
        if asked.held.min_layer_time_s is not None:
            raise InputError(
                "min_layer_time_s cannot be checked in G-code alone", advice="add --plan plan.json"
            )
        return judge_heads_alone(results, source, asked)
    document = read_plan(plan)
    read = read_as_planned(document, source, plate_of(source, asked.plate))
    verdict = judge_plan(document, read, asked)
    if is_other_print(verdict.faults):
        return verdict
    files = judge_heads(results, read, document)
    every, counts = (*verdict.faults, *files.faults), {**verdict.counts, **files.counts}
    return replace(verdict, faults=every, counts=counts)


def judge(result: Path, source: Path | None, asked: Judging, report: Report) -> Verdict:
    """Verify a plan file, or a G-code file against its source."""
    if is_plan(result):
        plan, read = read_plan(result), None
        if source is not None:
            read = read_as_planned(plan, source, plate_of(source, asked.plate))
        return judge_plan(plan, read, asked)
    if rules := asked.held.names():
        raise InputError(
            f"{', '.join(rules)}: only the order of a plan.json is held to rules",
            path=result,
            advice="leave them out, or verify the plan.json",
        )
    if source is None:
        raise InputError("a G-code file needs its source", advice="add --source IN.gcode")
    refuse_mesh(source, "verify against the slicer's G-code (`plan --sliced`), or verify plan.json")
    of_result, of_source = plate_of(result, asked.plate), plate_of(source, asked.plate)
    name, (place, of) = header_of(load_text(result, of_result))
    if name:
        raise InputError(
            f"this is the file of one head of several (head {name}, file {place} of {of})",
            path=result,
            advice="name the files of all heads, with --plan plan.json if you have it",
        )
    chosen, origin = machine_for(asked.machine, source, of_source)
    if origin:
        report(Note(origin))
    job, document = read_gcode(source, of_source)
    if load_text(result, of_result) != load_text(source, of_source):
        return verify_written(result, job, document, chosen, plate=of_result)
    verdict = verify_same(job, document, chosen)
    if read_bytes(result) == read_bytes(source):  # what a slicer wrote may have line numbers
        return verdict
    numbered = check_line_numbers(line_with_number(result, of_result))
    return replace(verdict, faults=(*numbered, *verdict.faults))


def judge_plan(document: PlanDocument, source: Source | None, asked: Judging) -> Verdict:
    """Verify a plan by the rules it states, or by those that `held` names.

    Stating a shorter `min_layer_time_s` than the source's slicer keeps is a fault, unless `held`
    names one.
    """
    held, machine = asked.held, asked.machine
    rule = held.min_layer_time_s
    rules = held.over(document.rules or usual_rules(document.machine)) if held.any_rule else None
    job = None
    if source is not None:
        epochs = epochs_of_source(document.contours)
        job, _ = as_planned(epochs, document.machine, source.job, source.document)
    verdict = verify_plan(
        replace(document, min_layer_time_s=document.min_layer_time_s if rule is None else rule),
        source=job,
        machine=load_machine(machine) if isinstance(machine, str) else machine,
        rules=rules,
        digest=digest_of(document),
        trials=asked.trials,
        seed=asked.seed,
    )
    if source is not None and source.towerless:
        verdict = _without_tower(verdict)
    if job is None or rule is not None or is_other_print(verdict.faults):
        return verdict
    less = check_stated(document, job, rules or document.rules or usual_rules(document.machine))
    return replace(verdict, faults=(*verdict.faults, *less))


def is_whole_team(path: Path, plate: int | None = None) -> bool:
    """Tell whether this is the only file that `launch` wrote, for a machine with one head."""
    return not is_plan(path) and header_of(load_text(path, plate_of(path, plate)))[1] == (1, 1)


def plate_of(path: Path, plate: int | None) -> int | None:
    """Return the plate to read of a file: none of one that has none."""
    return plate if plate is not None and has_plates(path) else None


def digest_of(document: PlanDocument) -> str:
    """Return the digest of the document's own contours, precedence and machine."""
    graph = DependencyGraph.from_pairs(len(document.contours), document.precedence)
    return problem_digest(document.contours, graph, document.machine)


def ordered(paths: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """Return the files in the order that their headers state, and the head of each.

    Raises InputError when one of them is not the file of one head of several.
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


def read_as_planned(plan: PlanDocument, source: Path, plate: int | None) -> Source:
    """Read a source as its plan was made of it: in which order, with its wipe tower or without.

    What is read stands in a folder that is gone with the source that is returned.
    """
    job, document = read_gcode(source, plate)
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
    verdict = verify_heads(plan.machine, files, plan.plan, job, document)
    return Verdict((*faults, *verdict.faults), verdict.counts)


def judge_heads_alone(paths: Sequence[Path], source: Path, asked: Judging) -> Verdict:
    """Verify the files of all heads by what they do on the machine, without their plan.

    The order is held to the default rules, with those that `held` names in their place.
    """
    machine, held = asked.machine, asked.held
    job, document = read_gcode(source, asked.plate)
    chosen = machine if isinstance(machine, Machine) else load_machine(machine or "dual-gantry")
    chosen = parked_above(replace(chosen, limits=chosen.limits.under(job.limits)), job.contours)
    paths, named = ordered(paths)
    files = [read_head_file(path, chosen.words) for path in paths]
    for file in files:
        if is_cut(file.lines.text):
            raise InputError(
                "contours are cut in it, and which are pieces of what only the plan says",
                path=file.path,
                advice="add --plan plan.json, as `launch --plan` writes it",
            )
    names = [head.name for head in chosen.heads]
    faults = misnamed(paths, named, chosen)
    if sorted(file.name for file in files) != sorted(names):
        there, due = ", ".join(file.name for file in files), ", ".join(names)
        text = f"there are files of heads {there}; machine {chosen.name} has {due}"
        text += "" if machine else " (another is named with --machine)"
        return Verdict((*faults, Fault(FaultKind.MISSING, text)))
    rules = held.over(usual_rules(chosen)) if held.any_rule else None
    judged = partial(_judge_alone, files, machine=chosen, rules=rules, asked=asked)
    found = judged(source=(job, document))
    for taken in () if found.ok else _taken_otherwise(job, document, chosen, asked.plate):
        other = judged(source=taken)
        if len(taken[0].contours) < len(job.contours):
            other = _without_tower(other)
        found = min(other, found, key=lambda verdict: len(verdict.faults))
    return replace(found, faults=(*faults, *found.faults))


def _without_tower(verdict: Verdict) -> Verdict:
    return replace(verdict, checked=(*verdict.checked, "the source's wipe tower is left out"))


def _taken_otherwise(
    job: PrintJob, document: GcodeDocument, machine: Machine, plate: int | None
) -> Iterator[tuple[PrintJob, GcodeDocument]]:
    """Yield other ways in which a source may have been taken."""
    if (phases := in_phases(job, document)) is not None:
        yield phases
    readings = [(job, document)]
    if one_tool_each(machine, job.contours):
        readings.append(read_without_tower(document, plate))
    for reading in readings:
        if (free := without_changes(*reading)) is not None:
            yield free


def _judge_alone(
    files: Sequence[HeadFile], *, source: tuple[PrintJob, GcodeDocument],
    machine: Machine, rules: OrderRules | None, asked: Judging,
) -> Verdict:  # fmt: skip
    """Verify files of heads against one reading of their source."""
    job, document = source
    plan, altered = plan_of_files(files, job, machine)
    if is_other_print(altered):
        return Verdict(tuple(altered))
    # Its times are made up. How near signals are is judged by the files' own lines, below.
    made_up = replace(plan, machine=replace(plan.machine, signal_interval_s=0.0))
    verdict = verify_plan(made_up, source=job, rules=rules, trials=asked.trials, seed=asked.seed)
    more = verify_heads(machine, files, plan.plan, job, document, read=True)
    every = (*altered, *verdict.faults, *more.faults)
    checked = (*verdict.checked[:1], WITHOUT_PLAN)
    counts = {**verdict.counts, **more.counts}
    return replace(verdict, faults=every, counts=counts, checked=checked)


def misnamed(paths: Sequence[Path], named: Sequence[str], machine: Machine) -> list[Fault]:
    """Return a fault for each file named after another head: it would go to its controller."""
    lines = []
    for path, name in zip(paths, named, strict=True):
        stem = path.name.removesuffix(".gz").removesuffix(".gcode")
        ends = [head.name for head in machine.heads if stem.endswith(f"_{head.name}")]
        if ends and name not in ends:
            lines.append(f"{path.name} is the file of head {name}")
    return listed(FaultKind.COMMAND, lines)


def refuse_mesh(source: Path, advice: str) -> None:
    """Raise InputError for a source that holds no extrusions to compare with."""
    if is_mesh(source):
        raise InputError(
            "what was made of a mesh cannot be compared with it", path=source, advice=advice
        )
