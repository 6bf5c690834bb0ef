"""`decmcts plan`: one head, from file to verified G-code, plan and pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from decmcts.cli import options as opt
from decmcts.cli import sop
from decmcts.cli.ahead import (
    PRINT,
    compilation_announced,
    compile_beside,
    compiling_beside,
    is_compiled,
    parts_of,
)
from decmcts.cli.app import app, machine_for
from decmcts.cli.bound import bound_line
from decmcts.cli.console import err, gain_table, out, print_json, steps, written
from decmcts.cli.first_check import refuse_unsound
from decmcts.cli.no_slower import kept_line, write_no_slower
from decmcts.cli.outputs import (
    STDOUT,
    FileTimes,
    figures,
    layers_line,
    name_of,
    refuse_other_suffixes,
    refuse_two_on_stdout,
    refuse_unpackable,
    refuse_unwritable,
    whole_file_line,
    write_extras,
)
from decmcts.cli.pipeline import Planned, load, plan_single, single_head_machine, source_plan
from decmcts.cli.quality import Quality, cooling_line
from decmcts.cli.signals import interrupt_stops
from decmcts.cli.slicing import AUTO, Chosen, Slicing, choose_slicer
from decmcts.errors import InputError
from decmcts.formats.drafts import draft_folder
from decmcts.formats.gcode.source_text import save_text
from decmcts.formats.mesh import MESH_SUFFIXES, SliceOptions
from decmcts.formats.sop import is_sop
from decmcts.print.plan import PlanDocument
from decmcts.search.sequence.pace import pace_of

ONLY_SHOWN = (
    "nothing will be written, as neither -o nor --plan, --report or --picture is given: "
    "this shows what a new order saves"
)


@app.command()
def plan(
    context: typer.Context,
    source: opt.Input,
    output: opt.GcodeOption = None,
    machine: opt.MachineOption = None,
    planner: opt.PlannerOption = opt.Planner.HYBRID,
    freedom: opt.FreedomOption = opt.Freedom.REVERSIBLE,
    seam: opt.SeamOption = None,
    process_order: opt.ProcessOption = opt.ProcessOrder.KEEP,
    objective: opt.ObjectiveOption = opt.Objective.TRAVEL,
    limits: opt.LimitsOption = opt.Limits.SOURCE,
    quality: opt.QualityOption = None,
    min_layer_time: opt.CoolingOption = None,
    max_layers_ahead: opt.LeadOption = None,
    time_limit: opt.TimeOption = 30.0,
    seed: opt.SeedOption = 0,
    allow_slower: opt.SlowerOption = False,
    certificate: Annotated[
        bool,
        typer.Option(
            help="Prove how far from optimal the travel is at most", rich_help_panel=opt.SEARCH
        ),
    ] = True,
    plan_file: opt.PlanOption = None,
    report: opt.ReportOption = None,
    picture: opt.PictureOption = None,
    as_json: opt.JsonOption = False,
    layer_height: opt.LayerHeight = 0.2,
    nozzle: opt.Nozzle = 0.4,
    density: opt.Density = 0.2,
    perimeters: opt.Perimeters = 2,
    slicer: opt.SlicerOption = AUTO,
    slicer_config: opt.SlicerConfig = None,
    temperature: opt.Temperature = 210.0,
    bed_temperature: opt.BedTemperature = 60.0,
    sliced: opt.Sliced = None,
) -> None:
    """Find a better order for one head and write it, verified; or solve a bare SOP."""
    if is_sop(source):
        sop.refuse_for_sop(context)
        sop.plan_sop(source, output, time_limit_s=time_limit, seed=seed, as_json=as_json)
        return
    refuse_for_gcode(context, source)
    edits = source.suffix.lower() not in MESH_SUFFIXES
    refuse_unwritable([output, plan_file, report, picture, sliced], source, edits=edits)
    refuse_unpackable(output, source)
    refuse_other_suffixes(plan_file, report, picture)
    refuse_two_on_stdout(output, as_json=as_json)
    policy = seam_of(freedom, seam)
    only_shown = not (as_json or output or plan_file or report or picture or sliced)
    slicing = slicing_of(
        context,
        choose_slicer(slicer, slicer_config),
        SliceOptions(
            layer_height=layer_height, nozzle=nozzle, density=density, perimeters=perimeters,
            temperature=temperature, bed_temperature=bed_temperature, skirts=2, fan_percent=100.0,
        ),
    )  # fmt: skip
    planned = run_single(
        source,
        machine,
        planner=planner.value,
        freedom=freedom.value,
        seam=policy,
        process_order=process_order.value,
        objective=objective.value,
        limits=limits.value,
        quality=Quality(quality, min_layer_time, max_layers_ahead),
        time_limit_s=time_limit,
        seed=seed,
        slicing=slicing,
        certificate=certificate,
        writes=output is not None,
        remark=ONLY_SHOWN if only_shown else "",
    )
    planned, times, paths = write(
        planned, output, allow_slower=allow_slower, plan_file=plan_file, report=report,
        picture=picture, sliced=sliced,
    )  # fmt: skip
    with written():
        show(planned, paths, times, as_json=as_json, to=err if output == STDOUT else out)
        if only_shown:
            err.print("nothing was written; `-o OUT.gcode` writes the new order", soft_wrap=True)


def write(
    planned: Planned,
    output: Path | None,
    *,
    allow_slower: bool,
    plan_file: Path | None,
    report: Path | None,
    picture: Path | None,
    sliced: Path | None,
) -> tuple[Planned, FileTimes | None, list[Path]]:
    """Write what was asked for; returns what it shows, its times and the names of the files."""
    times: FileTimes | None = None
    # a first Ctrl-C lets everything be written
    with interrupt_stops() as stop, steps() as (announce, _):
        if output is not None:
            planned, times = write_no_slower(
                planned, output, announce, allow_slower=allow_slower, stop=stop
            )
        paths = [output] if output is not None else []
        if plan_file or report or picture:
            announce("writing plan, report and pictures")
            paths += write_extras(planned, plan=plan_file, report=report, picture=picture)
        if sliced is not None and planned.loaded.sliced_by:
            save_text(Path(planned.loaded.document.path).read_bytes(), sliced)
            paths.append(sliced)
    return planned, times, paths


def slicing_of(context: typer.Context, chosen: Chosen, options: SliceOptions) -> Slicing:
    """Return how meshes are sliced, with a folder that goes when the command ends."""
    folder = context.with_resource(draft_folder())
    said = (context.get_parameter_source(name) for name in opt.MESH_OPTIONS)
    given = frozenset(
        name
        for name, origin in zip(opt.MESH_OPTIONS, said, strict=True)
        if origin is not None and origin.name == "COMMANDLINE"
    )
    return Slicing(chosen, options, given, folder)


def refuse_for_gcode(context: typer.Context, source: Path) -> None:
    """Raise InputError for an option of meshes given with a file that is none."""
    if source.suffix.lower() in MESH_SUFFIXES:
        return
    for option in context.command.params:
        origin = context.get_parameter_source(option.name or "")
        if option.name in opt.MESH_OPTIONS and origin is not None and origin.name == "COMMANDLINE":
            raise InputError(
                f"{option.opts[0]} is for meshes and means nothing here: this is no mesh "
                f"({', '.join(sorted(MESH_SUFFIXES))}), its beads are printed as they are",
                path=source,
                advice="leave it out, or set it in the slicer",
            )


def seam_of(freedom: opt.Freedom, seam: opt.Seam | None) -> str:
    """Return the seam policy; raises InputError for one that would mean nothing."""
    if seam is not None and freedom != opt.Freedom.SEAM:
        raise InputError(
            f"--seam {seam.value} needs --freedom seam, this is freedom {freedom.value}",
            advice="add --freedom seam, or leave --seam out",
        )
    return (seam or opt.Seam.NEAREST).value


def run_single(
    source: Path,
    machine: str | None,
    *,
    planner: str,
    freedom: str,
    process_order: str,
    quality: Quality,
    time_limit_s: float,
    seed: int,
    seam: str,
    slicing: Slicing | None = None,
    certificate: bool = False,
    objective: str = "travel",
    limits: str = "source",
    writes: bool = True,
    remark: str = "",
) -> Planned:
    """Load, plan and verify for one head (the first, where the machine has several).

    With `writes` what could not be written is refused before the search; the `remark` is
    made once the input is known to be of use.
    """
    chosen, origin = machine_for(machine, source)
    if origin:
        err.print(origin, soft_wrap=True, markup=False)
    if len(chosen.heads) > 1:
        head, n = chosen.heads[0].name, len(chosen.heads)
        err.print(
            f"{chosen.name} has {n} heads; planned for {head} alone, `decmcts launch` uses all",
            soft_wrap=True,
        )
        chosen = single_head_machine(chosen, 0)
    unit = "s" if objective == "time" else "mm"
    with (
        steps(time_limit_s=time_limit_s, unit=unit) as (said, searched),
        compilation_announced(said) as announce,
        compiling_beside(parts_of(planner, objective, freedom)),
    ):
        loaded = load(
            source,
            chosen,
            process_order=process_order,
            quality=quality,
            options=SliceOptions(),
            slicing=slicing,
            announce=announce,
            own_limits=limits == "source",
            freedom=freedom,
        )
        if objective == "time" and pace_of(loaded.job, loaded.machine.limits).looks_at_walls:
            compile_beside(parts_of(planner, objective, freedom, walls=True))

        def judged() -> PlanDocument:
            before = source_plan(loaded)
            refuse_unsound(loaded, before, writes=writes)
            if remark:
                err.print(remark, soft_wrap=True)
            return before

        before: PlanDocument | None = None
        if is_compiled(PRINT):  # else compiling takes longer than what a search waits for
            announce("the source's own order, judged before anything is searched")
            before = judged()
        with interrupt_stops() as stop:  # from here on there is something to keep
            return plan_single(
                loaded,
                planner=planner,
                freedom=freedom,
                seam=seam,
                time_limit_s=time_limit_s,
                seed=seed,
                announce=announce,
                certificate=certificate,
                objective=objective,
                before=before,
                judged=judged,
                progress=searched,
                stop=stop,
            )


def show(
    planned: Planned,
    paths: list[Path],
    times: FileTimes | None = None,
    *,
    as_json: bool,
    to: Console = out,
) -> None:
    """Print the summary, for a person (`to` a console) or for a program."""
    before, after = planned.before.metrics, planned.after.metrics
    if as_json:
        print_json("decmcts-result/1", figures(planned, paths, times))
        return
    show_notes(planned)
    title = (
        f"{planned.loaded.path.name}: machine {planned.after.machine.name}, "
        f"planner {after['planner']} for {after['objective']}, seed {after['seed']}, verified"
    )
    by = planned.loaded.sliced_by
    to.print(title, soft_wrap=True)
    to.print(gain_table(before, after))
    whole = None if times is not None and times.kept else whole_file_line(planned, times)
    for line in (
        f"sliced by {by}" if by else "",
        bound_line(after),
        cooling_line(planned.after),
        whole,
        layers_line(planned),
    ):
        if line:
            to.print(line, soft_wrap=True)
    if times is not None and times.kept:
        to.print(f"kept the source as it is: {kept_line(times)}", soft_wrap=True)
    for path in paths:
        to.print(f"wrote {name_of(path)}", soft_wrap=True)


def show_notes(planned: Planned) -> None:
    """Say what in the source bound the search, or was not taken as it is."""
    for barrier in planned.loaded.job.barriers:
        err.print(
            f"nothing moves across line {barrier.line}: {barrier.text} ({barrier.reason})",
            soft_wrap=True,
        )
    for note in planned.loaded.job.notes:
        err.print(note, soft_wrap=True)
