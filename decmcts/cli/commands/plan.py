"""`decmcts plan`: one head, from file to verified G-code, plan and pictures."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from decmcts.cli import options as opt
from decmcts.cli.console import SafeConsole, err, out, print_json, running, steps, written
from decmcts.cli.lines import (
    bound_line,
    changes_line,
    figures,
    gain_table,
    searched_line,
    whole_file_line,
)
from decmcts.cli.signals import interrupt_stops
from decmcts.errors import InputError
from decmcts.formats.bare.sop import is_sop
from decmcts.formats.gcode.text.source_text import save_text
from decmcts.formats.mesh import MESH_SUFFIXES, SliceOptions, is_mesh, refuse_other_shape
from decmcts.planning.compiling import compiling_beside, parts_for
from decmcts.planning.events import Report, Step, unheard
from decmcts.planning.options import RULES, SEARCH, Limits, PlannerName, Rules, Search
from decmcts.planning.plan import plan as find_order
from decmcts.planning.problem.slicing import AUTO, Slicing, choose_slicer
from decmcts.planning.problem.source import read
from decmcts.planning.result import Result, Written
from decmcts.planning.writing.lines import cooling_line, layers_line, source_lines
from decmcts.planning.writing.places import (
    STDOUT,
    name_of,
    refuse_other_suffixes,
    refuse_stdout,
    refuse_two_on_stdout,
    refuse_unpackable,
    refuse_unwritable,
)
from sim.pictures.layer_travels import require_layer

ONLY_SHOWN = (
    "nothing will be written, as neither -o nor --plan, --report or --picture is given: "
    "this shows what a new order saves"
)


@opt.app.command()
def plan(
    context: typer.Context,
    source: opt.Input,
    output: opt.GcodeOption = None,
    machine: opt.MachineOption = None,
    plate: opt.PlateOption = None,
    planner: opt.PlannerOption = PlannerName.HYBRID,
    freedom: opt.FreedomOption = RULES.freedom,
    seam: opt.SeamOption = RULES.seam,
    process_order: opt.ProcessOption = RULES.process_order,
    objective: opt.ObjectiveOption = SEARCH.objective,
    limits: opt.LimitsOption = Limits.SOURCE,
    quality: opt.QualityOption = None,
    min_layer_time: opt.CoolingOption = None,
    max_layers_ahead: opt.LeadOption = None,
    avoid_walls: opt.AvoidOption = RULES.avoid_walls,
    time_limit: opt.TimeOption = SEARCH.time_limit_s,
    seed: opt.SeedOption = 0,
    allow_slower: opt.SlowerOption = False,
    certificate: Annotated[
        bool,
        opt.search(
            "--certificate/--no-certificate", "Prove how far from optimal the travel is at most"
        ),
    ] = True,
    plan_file: opt.PlanOption = None,
    report: opt.ReportOption = None,
    picture: opt.PictureOption = None,
    picture_layer: opt.LayerOption = None,
    as_json: opt.JsonOption = False,
    verbose: opt.VerboseOption = False,
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
        from decmcts.cli.commands import bare  # its search loads for those who ask

        bare.solve(
            context, bare.SOP, source, output, time_limit_s=time_limit, seed=seed, as_json=as_json
        )
        return
    refuse_for_gcode(context, source)
    edits = not is_mesh(source)
    refuse_unwritable([output, plan_file, report, picture, sliced], source, edits=edits)
    refuse_unpackable(output, source, plate)
    refuse_other_suffixes(plan_file, report, picture)
    refuse_two_on_stdout(output, as_json=as_json)
    refuse_stdout(sliced, "--sliced")
    rules = Rules(
        process_order, quality, min_layer_time, max_layers_ahead, freedom, seam, avoid_walls
    )
    opt.refuse_layer_alone(picture_layer, picture)
    only_shown = not (as_json or output or plan_file or report or picture or sliced)
    slicing = Slicing(
        None if (slicer, slicer_config) == (AUTO, None) else choose_slicer(slicer, slicer_config),
        SliceOptions(
            layer_height=layer_height, nozzle=nozzle, density=density, perimeters=perimeters,
            temperature=temperature, bed_temperature=bed_temperature,
        ),
        frozenset(opt.MESH_OPTIONS) & opt.given(context).keys(),
    )  # fmt: skip
    search = Search(time_limit, seed, planner, objective, certificate=certificate)
    result = run_single(
        source, machine, search, rules, limits=limits, slicing=slicing, plate=plate,
        writes=output is not None, remark=ONLY_SHOWN if only_shown else "",
        picture_layer=picture_layer,
    )  # fmt: skip
    made, paths = write(
        result, output, allow_slower=allow_slower, plan_file=plan_file, report=report,
        picture=picture, picture_layer=picture_layer, sliced=sliced,
    )  # fmt: skip
    with written():
        show(made, paths, as_json=as_json, verbose=verbose, to=err if output == STDOUT else out)
        if only_shown:
            err.show("nothing was written; `-o OUT.gcode` writes the new order")


def write(
    result: Result,
    output: Path | None,
    *,
    allow_slower: bool,
    plan_file: Path | None,
    report: Path | None,
    picture: Path | None,
    picture_layer: int | None,
    sliced: Path | None,
) -> tuple[Written, list[Path]]:
    """Write what was asked for; returns what was written and the names of all files."""
    made = Written(result, ())
    # a first Ctrl-C lets everything be written
    with interrupt_stops() as stop, steps() as progress:
        if output is not None:
            made = result.write_gcode(output, allow_slower=allow_slower, report=progress, stop=stop)
        paths = [] if output is None else [output]
        paths += write_extras(made.result, plan_file, report, picture, picture_layer, progress)
        if sliced is not None and result.source.sliced_by:
            save_text(Path(result.source.document.path).read_bytes(), sliced)
            paths.append(sliced)
    return made, paths


def write_extras(
    result: Result,
    plan: Path | None,
    report: Path | None,
    picture: Path | None,
    layer: int | None = None,
    progress: Report = unheard,
) -> list[Path]:
    """Write report, picture (of one layer) and plan.json where asked; returns what was written.

    A report or a picture that cannot be written costs nothing else: it is told of. InputError
    when plan.json cannot be written.
    """
    draw = partial(result.write_picture, layer=layer)
    works = ((report, result.write_report), (picture, draw), (plan, result.write_plan))
    asked = [(path, write) for path, write in works if path is not None]
    kept = []
    for number, (path, write) in enumerate(asked, 1):
        progress(Step(f"writing {path.name}", number, len(asked)))
        try:
            write(path)
        except InputError as error:
            if path is plan:
                raise
            err.show(f"{error}; all else that was asked for is written")
        else:
            kept.append(path)
    return sorted(kept, key=lambda path: path is not plan)


def refuse_for_gcode(context: typer.Context, source: Path) -> None:
    """Raise InputError for an option of meshes given with a file that is none."""
    if is_mesh(source):
        return
    refuse_other_shape(source)
    for name, spellings in opt.given(context).items():
        if name in opt.MESH_OPTIONS:
            raise InputError(
                f"{spellings[0]} is for meshes and means nothing here: this is no mesh "
                f"({', '.join(sorted(MESH_SUFFIXES))}), its beads are printed as they are",
                path=source,
                advice="leave it out, or set it in the slicer",
            )


def run_single(
    source: Path,
    machine: str | None,
    search: Search,
    rules: Rules,
    *,
    limits: Limits,
    slicing: Slicing | None = None,
    plate: int | None = None,
    writes: bool = True,
    make_safe: bool = True,
    remark: str = "",
    picture_layer: int | None = None,
    logged: bool = True,
) -> Result:
    """Read, plan and verify for one head, and show how that goes.

    With `writes` what could not be written is refused before the search; the `remark` is
    made once the input is known to be of use. So is a `picture_layer` the print has not.
    """
    with (
        running(
            time_limit_s=search.time_limit_s, unit=search.unit, remark=remark, logged=logged
        ) as (progress, stop),
        compiling_beside(parts_for(search, rules.freedom), progress),  # while the source is read
    ):
        found = read(source, machine, limits=limits, mesh=slicing, plate=plate, report=progress)
        require_layer(picture_layer, found.job.contours)
        return find_order(
            found, search, rules, writes=writes, make_safe=make_safe, report=progress, stop=stop
        )


def show(
    made: Written, paths: list[Path], *, as_json: bool, verbose: bool = False, to: SafeConsole = out
) -> None:
    """Print the summary, for a person (`to` a console) or for a program."""
    result, times = made.result, made.times
    planned = result.planned
    before, after = planned.before.metrics, planned.after.metrics
    if as_json:
        print_json("decmcts-result/1", figures(result, paths, times))
        return
    err.show(*source_lines(planned.problem.job))
    kept = times is not None and times.kept
    to.show(titled(result))
    if not kept:  # else nothing has changed
        to.print(gain_table(before, after, verbose=verbose))
    fewer = "" if kept else changes_line(before, after)
    to.show(
        searched_line(after) if verbose else "",
        f"sliced by {result.source.sliced_by}" if result.source.sliced_by else "",
        fewer,
        "" if kept else bound_line(result.bound, verbose=verbose, fewer_changes=bool(fewer)),
        cooling_line(planned.after),
        None if kept else whole_file_line(times),
        layers_line(planned),
    )
    if kept:
        to.show(f"kept the source as it is: {after['kept_because']}")
    to.show(*(f"wrote {name_of(path)}" for path in paths))


def titled(result: Result) -> str:
    """Return what a summary is headed by."""
    document = result.document
    contours = f"{len(document.contours):,} contours"
    return f"{result.source.name} on {document.machine.name}: {contours}, verified"
