"""`decmcts verify` and `decmcts machines`."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any

import typer

from decmcts.cli import options as opt
from decmcts.cli.app import app, machine_for
from decmcts.cli.console import err, out, print_json, steps
from decmcts.cli.heads import judge_heads, judge_heads_alone, refuse_mesh, source_of
from decmcts.errors import InputError
from decmcts.feasibility.digest import problem_digest
from decmcts.feasibility.graph import DependencyGraph
from decmcts.formats.gcode import read_gcode, read_result
from decmcts.formats.gcode.source_text import load_text
from decmcts.formats.machine_file import load_machine, preset_names
from decmcts.formats.plan_json import read_plan
from decmcts.print.machine import Machine
from decmcts.print.plan import PlanDocument
from sim.content.same_print import is_other_print
from sim.content.seams import seams_of_file
from sim.faults import Verdict
from sim.files.written import check_state
from sim.heads.file import header_of
from sim.rules.cooling import check_stated
from sim.rules.order_rules import usual_rules
from sim.verify import verify_motions, verify_plan

Result = Annotated[
    list[Path], typer.Argument(help="PLAN.json, OUT.gcode, or the files of all heads")
]
SourceOption = Annotated[
    Path | None,
    typer.Option(
        "--source", rich_help_panel=opt.BASICS, metavar="FILE", help="The G-code it was made from"
    ),
]
MadeFromOption = Annotated[
    Path | None,
    typer.Option(
        "--plan",
        rich_help_panel=opt.BASICS,
        metavar="FILE",
        help="Of files of several heads: the plan.json they were made from",
    ),
]
TrialsOption = Annotated[
    int,
    typer.Option(
        rich_help_panel=opt.SEARCH,
        metavar="N",
        min=1,
        help="Random timing trials of a joint plan",
    ),
]


@app.command()
def verify(
    result: Result,
    source: SourceOption = None,
    plan: MadeFromOption = None,
    machine: opt.MachineOption = None,
    process_order: opt.HeldProcessOption = None,
    quality: opt.HeldQualityOption = None,
    min_layer_time: opt.HeldCoolingOption = None,
    max_layers_ahead: opt.HeldLeadOption = None,
    freedom: opt.HeldFreedomOption = None,
    seed: opt.SeedOption = 0,
    trials: TrialsOption = 3,
    as_json: opt.JsonOption = False,
) -> None:
    """Replay a plan or a G-code file independently; one line a fault, exit code 1 if any."""
    for path in result:
        if not path.exists():
            raise InputError("no such file", path=path)
    with steps() as (announce, _):
        announce(f"verifying {', '.join(path.name for path in result)}")
        held = Held(
            None if process_order is None else process_order.value,
            quality,
            max_layers_ahead,
            None if freedom is None else freedom.value,
            min_layer_time,
        )
        if len(result) > 1 or plan is not None or is_whole_team(result[0]):
            verdict = judge_several(result, source, plan, machine, held, seed=seed, trials=trials)
        else:
            verdict = judge(result[0], source, machine, held, seed=seed, trials=trials)
    show(verdict, ", ".join(map(str, result)), as_json=as_json)
    if verdict.faults:
        raise typer.Exit(1)


def show(verdict: Verdict, names: str, *, as_json: bool) -> None:
    """Print what was found in the files of these names, for a person or for a program."""
    if as_json:
        faults = [str(fault) for fault in verdict.faults]
        found = {"ok": not faults, "faults": faults, "checked": list(verdict.checked)}
        print_json("decmcts-verdict/1", {"file": names, **found})
        return
    for fault in verdict.faults:
        out.print(str(fault), soft_wrap=True, markup=False)
    n = len(verdict.faults)
    state = f"{n} fault{'s' * (n > 1)}" if n else "no fault"
    for line in verdict.checked:
        err.print(line, soft_wrap=True, markup=False)
    err.print(f"{names}: {state}", soft_wrap=True)


@dataclass(frozen=True, slots=True)
class Held:
    """What the command line holds a plan to; None: as the plan says."""

    process_order: str | None = None
    quality: bool | None = None
    max_layers_ahead: int | None = None
    freedom: str | None = None
    min_layer_time_s: float | None = None

    def named(self) -> dict[str, Any]:
        """Return what was asked for."""
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in given.items() if value is not None}


AS_STATED = Held()


def judge_several(
    results: list[Path],
    source: Path | None,
    plan: Path | None,
    machine: str | None,
    held: Held,
    *,
    seed: int,
    trials: int,
) -> Verdict:
    """Verify the files of all heads together, with the plan they were made from or without."""
    given = source_of(source)
    if plan is None:
        asked = held.named()
        if "min_layer_time_s" in asked:
            raise InputError("min_layer_time_s: files alone do not tell", advice="add --plan")
        return judge_heads_alone(results, given, machine, asked, seed=seed, trials=trials)
    verdict = judge(plan, given, machine, held, seed=seed, trials=trials)
    if is_other_print(verdict.faults):
        return verdict
    files = judge_heads(results, given, read_plan(plan))
    return Verdict(
        (*verdict.faults, *files.faults), {**verdict.counts, **files.counts}, verdict.checked
    )


def judge(
    result: Path,
    source: Path | None,
    machine: str | None,
    held: Held = AS_STATED,
    *,
    seed: int,
    trials: int,
) -> Verdict:
    """Verify a plan file, or a G-code file against its source."""
    if _is_plan(result):
        return judge_plan(result, source, machine, held, seed=seed, trials=trials)
    if asked := held.named():
        raise InputError(
            f"{', '.join(asked)}: only the order of a plan.json is held to rules",
            path=result,
            advice="leave them out, or verify the plan.json",
        )
    if source is None:
        raise InputError("a G-code file needs its source", advice="add --source IN.gcode")
    refuse_mesh(source, "verify against the slicer's G-code (`plan --sliced`), or verify plan.json")
    refuse_head_file(result)
    chosen, origin = machine_for(machine, source)
    if origin:
        err.print(origin, soft_wrap=True, markup=False)
    job, print_text, theirs = read_result(source)
    ours, _, motions = read_result(result)
    seams = list(seams_of_file(ours.contours, job.contours))
    verdict = verify_motions(motions, theirs, chosen, job=job, seams=seams)
    if is_other_print(verdict.faults):
        return verdict
    if load_text(result) == load_text(source):  # as `plan` leaves what cannot be made faster
        return Verdict(verdict.faults, verdict.counts, ("the file is its source, byte for byte",))
    state = check_state(result, job, print_text, seams=seams)
    return Verdict((*verdict.faults, *state), verdict.counts)


def judge_plan(
    result: Path,
    source: Path | None,
    machine: str | None,
    held: Held,
    *,
    seed: int,
    trials: int,
) -> Verdict:
    """Verify a plan file by the rules it states, as far as the command line names no others.

    But the time before a spot is printed over is no less than the source's slicer keeps.
    """
    document = read_plan(result)
    digest = digest_of(document)
    asked = held.named()
    rule = asked.pop("min_layer_time_s", document.min_layer_time_s)
    rules = replace(document.rules or usual_rules(document.machine), **asked) if asked else None
    job = read_gcode(source)[0] if source is not None else None
    verdict = verify_plan(
        replace(document, min_layer_time_s=rule),
        source=job,
        machine=load_machine(machine) if machine is not None else None,
        rules=rules,
        digest=digest,
        trials=trials,
        seed=seed,
    )
    if job is None or held.min_layer_time_s is not None or is_other_print(verdict.faults):
        return verdict
    less = check_stated(document, job, rules or document.rules or usual_rules(document.machine))
    return replace(verdict, faults=(*verdict.faults, *less))


def is_whole_team(path: Path) -> bool:
    """Tell whether this is the one file `launch` wrote for a machine with one head."""
    return not _is_plan(path) and header_of(load_text(path))[1] == (1, 1)


def _is_plan(path: Path) -> bool:
    return path.name.lower().endswith((".json", ".json.gz"))


def refuse_head_file(path: Path) -> None:
    """Raise InputError for the file of one head of several: alone it proves nothing.

    Such a file says so among its first lines.
    """
    name, (place, of) = header_of(load_text(path))
    if name:
        raise InputError(
            f"this is the file of one head of several (head {name}, file {place} of {of})",
            path=path,
            advice="name the files of all heads, with --plan plan.json if you have it",
        )


def digest_of(document: PlanDocument) -> str:
    """Return the digest the document's own contours, order and machine have."""
    graph = DependencyGraph.from_pairs(len(document.contours), document.precedence)
    return problem_digest(document.contours, graph, document.machine)


@app.command()
def machines(
    draw: Annotated[
        Path | None,
        typer.Option(
            "--draw",
            metavar="FOLDER",
            help="Folder for a PNG of every machine listed",
            rich_help_panel=opt.OUTPUT,
        ),
    ] = None,
    machine: opt.ListedMachineOption = None,
    as_json: opt.JsonOption = False,
) -> None:
    """List the machines; with --draw, draw their heads."""
    if draw is not None and not draw.is_dir():
        raise InputError("no such folder", path=draw, advice="make it first")
    listed = [load_machine(name) for name in ([machine] if machine else preset_names())]
    for m in listed if draw is not None else []:
        from sim.pictures.drawings import draw_machine  # takes a second to load

        assert draw is not None
        draw_machine(m, draw / f"{m.name}.png")
    if as_json:
        print_json("decmcts-machines/1", {"machines": [facts(m) for m in listed]})
        return
    for m in listed:
        show_machine(m)
    if draw is not None:
        out.print(f"wrote a PNG a machine to {draw}", soft_wrap=True)


def show_machine(m: Machine) -> None:
    """Print a machine in a few lines."""
    from rich.padding import Padding

    known = facts(m)
    bed = f"{m.bed_max[0] - m.bed_min[0]:g}×{m.bed_max[1] - m.bed_min[1]:g} mm"
    slices = ", ".join(f"{height:g}" for height in known["slices_mm"])
    heads = " ".join(known["heads"])
    out.print(f"{m.name}: bed {bed}, heads: {heads}, slices at {slices} mm", soft_wrap=True)
    out.print(Padding(m.source.split(";")[0], (0, 0, 0, 4)))


def facts(m: Machine) -> dict[str, Any]:
    """Return what `--json` prints of a machine."""
    return {
        "name": m.name,
        "source": m.source,
        "bed_min": list(m.bed_min),
        "bed_max": list(m.bed_max),
        "heads": [head.name for head in m.heads],
        "slices_mm": [float(part.height_mm) for part in m.heads[0].slices],
    }
