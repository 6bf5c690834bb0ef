"""Judging a plan or finished files again, by the rules they state or by others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from decmcts.errors import InputError
from decmcts.feasibility.digest import problem_digest
from decmcts.feasibility.graph import DependencyGraph
from decmcts.formats.files.reading import read_bytes
from decmcts.formats.gcode import read_gcode
from decmcts.formats.gcode.text.source_text import has_plates, line_with_number, load_text
from decmcts.formats.machines.machine_file import load_machine
from decmcts.formats.plans.plan_json import is_plan, read_plan
from decmcts.planning.events import Note, Report, unheard
from decmcts.planning.problem.made_from import is_made_from
from decmcts.planning.problem.source import Source, machine_for
from decmcts.planning.verifying.heads import (
    judge_heads,
    judge_heads_alone,
    read_as_planned,
    refuse_mesh,
    source_of,
)
from decmcts.planning.verifying.held import AS_STATED, Held
from decmcts.print.machine import Machine
from decmcts.print.plan import PlanDocument
from sim.content.pieces import epochs_of_source
from sim.content.rest import RestCheck, check_rest
from sim.content.same_print import is_other_print
from sim.faults import Verdict
from sim.files.written import check_line_numbers, verify_same, verify_written
from sim.heads.changes import as_planned
from sim.heads.file import header_of
from sim.rules.cooling import check_stated
from sim.rules.order_rules import usual_rules
from sim.verify import verify_plan


def judge_several(
    results: list[Path],
    source: Path | None,
    plan: Path | None,
    machine: str | Machine | None,
    held: Held,
    *,
    seed: int,
    trials: int,
    plate: int | None = None,
    without_tower: bool = False,
) -> Verdict:
    """Verify the files of all heads together, with the plan they were made from or without."""
    given = source_of(source)
    if plan is None:
        if held.min_layer_time_s is not None:
            raise InputError(
                "min_layer_time_s cannot be checked in G-code alone", advice="add --plan plan.json"
            )
        return judge_heads_alone(
            results, given, machine, held, seed=seed, trials=trials, plate=plate,
            without_tower=without_tower,
        )  # fmt: skip
    document = read_plan(plan)
    read = read_as_planned(document, given, plate_of(given, plate), without_tower=without_tower)
    verdict = judge_plan(document, read, machine, held, seed=seed, trials=trials)
    if is_other_print(verdict.faults):
        return verdict
    files = judge_heads(results, read, document)
    every, counts = (*verdict.faults, *files.faults), {**verdict.counts, **files.counts}
    return replace(verdict, faults=every, counts=counts)


def judge(
    result: Path,
    source: Path | None,
    machine: str | Machine | None,
    held: Held = AS_STATED,
    *,
    seed: int,
    trials: int,
    plate: int | None = None,
    without_tower: bool = False,
    report: Report = unheard,
) -> Verdict:
    """Verify a plan file, or a G-code file against its source."""
    if is_plan(result):
        plan, read = read_plan(result), None
        if source is not None:
            of_source = plate_of(source, plate)
            read = read_as_planned(plan, source, of_source, without_tower=without_tower)
        return judge_plan(plan, read, machine, held, seed=seed, trials=trials)
    if without_tower:
        raise InputError(
            "the file of one head keeps its wipe tower", path=result,
            advice="leave --without-tower out",
        )  # fmt: skip
    if asked := held.names():
        raise InputError(
            f"{', '.join(asked)}: only the order of a plan.json is held to rules",
            path=result,
            advice="leave them out, or verify the plan.json",
        )
    if source is None:
        raise InputError("a G-code file needs its source", advice="add --source IN.gcode")
    refuse_mesh(source, "verify against the slicer's G-code (`plan --sliced`), or verify plan.json")
    of_result, of_source = plate_of(result, plate), plate_of(source, plate)
    refuse_head_file(result, of_result)
    chosen, origin = machine_for(machine, source, of_source)
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


def judge_plan(
    document: PlanDocument,
    source: Source | None,
    machine: str | Machine | None,
    held: Held,
    *,
    seed: int,
    trials: int,
) -> Verdict:
    """Verify a plan by the rules it states, or by those that `held` names.

    Stating a shorter `min_layer_time_s` than the source's slicer keeps is a fault, unless `held`
    names one.
    """
    digest = digest_of(document)
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
        digest=digest,
        trials=trials,
        seed=seed,
    )
    if job is None or rule is not None or is_other_print(verdict.faults):
        return verdict
    less = check_stated(document, job, rules or document.rules or usual_rules(document.machine))
    return replace(verdict, faults=(*verdict.faults, *less))


def judge_rest(plan: Path, source: Path | None, whole: Path) -> RestCheck:
    """Check the source of a rest against the plan that was broken off.

    Tools print for others where the plan of the rest says so. What is left out no plan says.

    Raises
    ------
    InputError
        Where the plan or the source of the rest is missing, or that of the whole print is named.
    """
    if not is_plan(plan):
        raise InputError("the plan of the rest is missing", advice="add --plan rest.json")
    if source is None:
        raise InputError("the source of the rest is missing", advice="add --source rest.gcode")
    rest, broken, (job, text) = read_plan(plan), read_plan(whole), read_gcode(source)
    if is_made_from(broken, job, text) and not is_made_from(rest, job, text):
        raise InputError(
            "this is the source of the plan that was broken off; the rest has one of its own",
            path=source,
            advice="name the one that `replan -o rest` wrote beside the heads' files: "
            "--source rest.gcode",
        )
    return check_rest(job.contours, rest.printed, broken, dict(rest.print_with))


def is_whole_team(path: Path, plate: int | None = None) -> bool:
    """Tell whether this is the only file that `launch` wrote, for a machine with one head."""
    return not is_plan(path) and header_of(load_text(path, plate_of(path, plate)))[1] == (1, 1)


def refuse_head_file(path: Path, plate: int | None) -> None:
    """Raise InputError for the file of one head of several, which cannot be judged alone.

    Its header says what it is.
    """
    name, (place, of) = header_of(load_text(path, plate))
    if name:
        raise InputError(
            f"this is the file of one head of several (head {name}, file {place} of {of})",
            path=path,
            advice="name the files of all heads, with --plan plan.json if you have it",
        )


def plate_of(path: Path, plate: int | None) -> int | None:
    """Return the plate to read of a file: none of one that has none."""
    return plate if plate is not None and has_plates(path) else None


def refuse_plate(plate: int | None, files: list[Path]) -> None:
    """Raise InputError for a plate of files of which none has plates."""
    if plate is not None and not any(map(has_plates, files)):
        raise InputError(f"no plate {plate}: only a .gcode.3mf has plates", advice="leave it out")


def digest_of(document: PlanDocument) -> str:
    """Return the digest of the document's own contours, precedence and machine."""
    graph = DependencyGraph.from_pairs(len(document.contours), document.precedence)
    return problem_digest(document.contours, graph, document.machine)
