"""`decmcts plan`: one head, from file to verified G-code, plan and pictures."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from decmcts.cli import options as opt
from decmcts.cli import sop
from decmcts.cli.app import app, interrupt_stops, machine_for
from decmcts.cli.bound import bound_line
from decmcts.cli.console import err, gain_table, out, print_json, steps, summary_of
from decmcts.cli.outputs import (
    FileTimes,
    figures,
    file_time_line,
    refuse_other_suffixes,
    refuse_unwritable,
    write_extras,
    write_single,
)
from decmcts.cli.pipeline import Planned, load, plan_single, single_head_machine
from decmcts.cli.quality import Quality, cooling_line
from decmcts.errors import InputError
from decmcts.formats.mesh import SliceOptions
from decmcts.formats.sop import is_sop


@app.command()
def plan(
    context: typer.Context,
    source: opt.Input,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Write G-code")] = None,
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
    certificate: Annotated[
        bool, typer.Option(help="Prove how far from optimal the travel is at most")
    ] = True,
    plan_file: opt.PlanOption = None,
    report: opt.ReportOption = None,
    picture: opt.PictureOption = None,
    as_json: opt.JsonOption = False,
    layer_height: opt.LayerHeight = 0.2,
    nozzle: opt.Nozzle = 0.4,
    density: opt.Density = 0.2,
    perimeters: opt.Perimeters = 2,
) -> None:
    """Find a better order for one head and write it, verified; or solve a bare SOP."""
    if is_sop(source):
        sop.refuse_for_sop(context)
        sop.plan_sop(source, output, time_limit_s=time_limit, seed=seed, as_json=as_json)
        return
    refuse_unwritable([output, plan_file, report, picture], source)
    refuse_other_suffixes(plan_file, report, picture)
    slicing = SliceOptions(
        layer_height=layer_height, nozzle=nozzle, density=density, perimeters=perimeters
    )
    planned = run_single(
        source,
        machine,
        planner=planner.value,
        freedom=freedom.value,
        seam=seam_of(freedom, seam),
        process_order=process_order.value,
        objective=objective.value,
        limits=limits.value,
        quality=Quality(quality, min_layer_time, max_layers_ahead),
        time_limit_s=time_limit,
        seed=seed,
        slicing=slicing,
        quiet=as_json,
        certificate=certificate,
    )
    started = time.perf_counter()
    times: FileTimes | None = None
    with interrupt_stops():  # a first Ctrl-C lets everything be written
        if output is not None:
            times = write_single(planned, output)
        planned.seconds["write"] = time.perf_counter() - started
        written = write_extras(planned, plan=plan_file, report=report, picture=picture)
    show(planned, [*([output] if output else []), *written], times, as_json=as_json)


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
    slicing: SliceOptions,
    quiet: bool,
    certificate: bool = False,
    objective: str = "travel",
    limits: str = "source",
) -> Planned:
    """Load, plan and verify for one head (the first, where the machine has several)."""
    chosen, origin = machine_for(machine, source)
    if origin and not quiet:
        err.print(origin, soft_wrap=True, markup=False)
    if len(chosen.heads) > 1:
        head, n = chosen.heads[0].name, len(chosen.heads)
        if not quiet:
            err.print(
                f"{chosen.name} has {n} heads; planned for {head} alone, `decmcts launch` uses all",
                soft_wrap=True,
            )
        chosen = single_head_machine(chosen, 0)
    with (
        interrupt_stops() as stop,
        steps(
            quiet=quiet, time_limit_s=time_limit_s, unit="s" if objective == "time" else "mm"
        ) as (announce, searched),
    ):
        loaded = load(
            source,
            chosen,
            process_order=process_order,
            quality=quality,
            options=slicing,
            announce=announce,
            own_limits=limits == "source",
            freedom=freedom,
        )
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
            progress=searched,
            stop=stop,
        )


def show(
    planned: Planned, written: list[Path], times: FileTimes | None = None, *, as_json: bool
) -> None:
    """Print the summary, for a person or for a program."""
    before, after = planned.before.metrics, planned.after.metrics
    if as_json:
        print_json(
            {
                **figures(planned),
                "gain": summary_of(before, after),
                **(
                    {"file_time_s": {"before": times.before_s, "after": times.after_s}}
                    if times
                    else {}
                ),
                "written": [str(path) for path in written],
            }
        )
        return
    for barrier in planned.loaded.job.barriers:
        err.print(f"nothing moves across line {barrier.line}: {barrier.text} ({barrier.reason})")
    for note in planned.loaded.job.notes:
        err.print(note)
    title = (
        f"{planned.loaded.path.name}: machine {planned.after.machine.name}, "
        f"planner {after['planner']} for {after['objective']}, seed {after['seed']}, verified"
    )
    out.print(gain_table(before, after, title))
    for line in (bound_line(after), cooling_line(planned.after)):
        if line:
            out.print(line, soft_wrap=True)
    if times is not None and times.before_s is not None:
        settings = planned.loaded.job.settings
        retracts = settings.firmware_retraction or settings.retract_mm > 0.0
        retracted_mm = settings.retract_min_travel_mm if retracts else None
        out.print(file_time_line(times.before_s, times.after_s, retracted_mm), soft_wrap=True)
    for path in written:
        out.print(f"wrote {path}", soft_wrap=True)
