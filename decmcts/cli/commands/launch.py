"""`decmcts launch`, `agent` and `demo`: several heads, each its own process."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from agents import extruder
from decmcts.cli import options as opt
from decmcts.cli.commands.plan import ONLY_SHOWN, titled, write_extras
from decmcts.cli.commands.replay import heads_table, recording
from decmcts.cli.console import err, out, print_json, running, steps, written
from decmcts.cli.lines import figures, gain_table, searched_line, team_lines
from decmcts.cli.signals import interrupt_stops
from decmcts.errors import InputError
from decmcts.formats.bare.qcsp import is_qcsp
from decmcts.formats.machines.machine_file import load_machine
from decmcts.formats.mesh import SliceOptions
from decmcts.planning.compiling import TEAM, compiling_beside
from decmcts.planning.events import Event, Heads, Step
from decmcts.planning.launch import crew_started
from decmcts.planning.launch import launch as launch_heads
from decmcts.planning.options import RULES, TEAM_SEARCH, Cut, Limits, Objective, Rules, TeamSearch
from decmcts.planning.problem.own_tools import with_tools
from decmcts.planning.problem.slicing import Slicing
from decmcts.planning.problem.source import read
from decmcts.planning.result import Result
from decmcts.planning.team.joint import lines_of
from decmcts.planning.writing.file_times import is_longer
from decmcts.planning.writing.heads import head_files, stem_of
from decmcts.planning.writing.lines import cooling_line, source_lines
from decmcts.planning.writing.places import refuse_other_suffixes, refuse_stdout, refuse_unwritable
from decmcts.print.machine import Machine
from decmcts.samples import sample_path
from decmcts.team.dec_mcts.parameters import read_parameters
from decmcts.team.engine.space import eligibility
from sim.pictures.layer_travels import require_layer


@opt.app.command()
def launch(
    context: typer.Context,
    source: opt.Input,
    output: Annotated[
        Path | None,
        opt.basics(
            "-o --output STEM",
            "Stem of the G-code files, one a head; of a .qcsp, the schedule's file",
        ),
    ] = None,
    machine: Annotated[
        str,
        opt.basics(
            "--machine NAME|FILE", "A machine with several heads, such as dual-gantry or rail-3"
        ),
    ] = "dual-gantry",
    tool: Annotated[
        list[str] | None,
        opt.basics(
            "--tool HEAD=N",
            "The tool of the source a head prints with, in place of the machine file's; may be "
            "given more than once",
        ),
    ] = None,
    plate: opt.PlateOption = None,
    freedom: opt.FreedomOption = RULES.freedom,
    seam: opt.SeamOption = RULES.seam,
    process_order: opt.ProcessOption = RULES.process_order,
    objective: Annotated[
        Objective,
        opt.search(
            "--objective",
            "The makespan comes first; this is what one head's own order and the points "
            "contours are entered at save: travel (mm) or time",
        ),
    ] = TEAM_SEARCH.objective,
    limits: opt.LimitsOption = Limits.SOURCE,
    quality: opt.QualityOption = None,
    min_layer_time: opt.CoolingOption = None,
    max_layers_ahead: opt.LeadOption = None,
    without_tower: opt.TowerOption = False,
    time_limit: opt.TimeOption = TEAM_SEARCH.time_limit_s,
    seed: opt.SeedOption = 0,
    team: Annotated[
        Path | None,
        opt.search("--team FILE", "Parameters of the heads' search, a TOML file (docs/team.md)"),
    ] = None,
    cut: Annotated[
        Cut,
        opt.search(
            "--cut",
            "What may be cut so that heads share it, where the print ends sooner so: "
            "nothing, infill and inner walls, or outer walls too",
        ),
    ] = TEAM_SEARCH.cut,
    weld_limit_s: opt.WeldOption = None,
    stagger_mm: opt.StaggerOption = None,
    plan_file: opt.PlanOption = None,
    report: opt.ReportOption = None,
    picture: opt.PictureOption = None,
    picture_layer: opt.LayerOption = None,
    record: Annotated[
        Path | None,
        opt.output("--record FILE", "Keep what the heads do as they plan, for `decmcts replay`"),
    ] = None,
    as_json: opt.JsonOption = False,
    verbose: opt.VerboseOption = False,
) -> None:
    """Plan for several heads: one process each, agreeing on one joint plan; or solve a QCSP."""
    if is_qcsp(source):
        from decmcts.cli.commands import bare  # its search loads for those who ask

        bare.solve(
            context, bare.QCSP, source, output, time_limit_s=time_limit, seed=seed, as_json=as_json
        )
        return
    rules = Rules(
        process_order, quality, min_layer_time, max_layers_ahead, freedom, seam,
        without_tower=without_tower,
    )  # fmt: skip
    of_cuts = {"--weld-limit-s": weld_limit_s, "--stagger-mm": stagger_mm}
    for option, given in of_cuts.items():
        if given is not None and cut is Cut.NONE:
            raise InputError(
                f"{option} {given:g} is of cuts, and --cut none makes none",
                advice="leave one of them out",
            )
    opt.refuse_layer_alone(picture_layer, picture)
    stem = None if output is None else stem_of(output)
    chosen = with_tools(load_machine(machine), tool or [])
    heads = [] if stem is None else head_files(stem, chosen)
    outputs = [*heads, plan_file, report, picture, record]
    refuse_unwritable(outputs, source, *([] if team is None else [team]))
    refuse_other_suffixes(plan_file, report, picture)
    refuse_stdout(record, "--record")
    only_shown = not (as_json or stem or plan_file or report or picture or record)
    parameters = {} if team is None else read_parameters(team)
    search = TeamSearch(
        time_limit, seed, objective, parameters, cut, weld_limit_s,
        stagger_mm=TEAM_SEARCH.stagger_mm if stagger_mm is None else stagger_mm,
    )  # fmt: skip
    result = run_team(
        source, chosen, search, rules, limits=limits, plate=plate, record=record,
        writes=stem is not None, remark=ONLY_SHOWN if only_shown else "",
        picture_layer=picture_layer,
    )  # fmt: skip
    with interrupt_stops(), steps() as progress:  # a first Ctrl-C lets everything be written
        paths = list[Path]()
        if stem is not None:
            progress(Step("putting the files of all heads in place"))
            paths = list(result.write_gcode(stem, report=progress).paths)
        paths += write_extras(result, plan_file, report, picture, picture_layer, progress)
    with written():
        show_team(result, paths, as_json=as_json, verbose=verbose)
        if only_shown:
            err.print("nothing was written; `-o STEM` writes the files of all heads")


def run_team(
    source: Path,
    machine: Machine,
    search: TeamSearch,
    rules: Rules,
    *,
    limits: Limits = Limits.SOURCE,
    plate: int | None = None,
    record: Path | None = None,
    writes: bool = True,
    remark: str = "",
    picture_layer: int | None = None,
) -> Result:
    """Read, let the agents plan and agree, verify, and show how that goes.

    With `writes` what no head's file could hold is refused before the search, and noted what
    it leaves out; the `remark` is made once the input is known to be of use.
    """
    with (
        running(time_limit_s=search.time_limit_s, remark=remark, table=heads_table) as (show, stop),
        recording(record) as keep,
        compiling_beside([TEAM], show),  # while the source is read
        crew_started(len(machine.heads)) as crew,
    ):

        def progress(event: Event) -> None:
            if isinstance(event, Heads):
                keep(event)
            show(event)

        mesh = Slicing(options=SliceOptions(skirts=0))  # start code primes the heads
        found = read(source, machine, limits=limits, mesh=mesh, plate=plate, report=progress)
        require_layer(picture_layer, found.job.contours)
        return launch_heads(
            found, search, rules, writes=writes, report=progress, stop=stop, crew=crew
        )  # fmt: skip


def show_team(result: Result, paths: list[Path], *, as_json: bool, verbose: bool = False) -> None:
    """Print the summary of a joint plan."""
    planned, problem = result.planned, result.planned.problem
    before, after = planned.before.metrics, planned.after.metrics
    if as_json:
        print_json("decmcts-result/1", figures(result, paths))
        return
    more = [cooling_line(planned.after)]
    if is_longer(before["makespan_s"], after["makespan_s"]):
        whole = eligibility(problem.job.contours, problem.machine.heads).all(axis=0)
        but = ": print the source" if whole.any() else ", but none reaches all of it"
        more.append(f"longer than one head in the source's own order{but}")
    show_joint(result, titled(result), paths, more, verbose=verbose)


def show_joint(
    result: Result,
    title: str,
    paths: list[Path],
    more: Sequence[str | None] = (),
    *,
    verbose: bool = False,
) -> None:
    """Print a title, what a joint plan gains, some lines more and what was written."""
    planned = result.planned
    before, after = planned.before.metrics, planned.after.metrics
    err.show(*source_lines(planned.problem.job), *lines_of(after["team"]))
    out.show(title)
    out.print(gain_table(before, after, verbose=verbose))
    searched = searched_line(after) if verbose else ""
    heads = team_lines(after, [head.head for head in result.document.plan.heads])
    out.show(searched, *heads, *more, *(f"wrote {path}" for path in paths))


@opt.app.command(
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
    add_help_option=False,
)
def agent(context: typer.Context) -> None:
    """Run one head's agent (what `launch` starts; `decmcts agent --help` for its options)."""
    raise typer.Exit(extruder.main(context.args))


@opt.app.command()
def demo(
    folder: Annotated[Path, opt.basics("--out FOLDER", "Folder for the results")] = Path("out"),
    time_limit: opt.TimeOption = 10.0,
    seed: opt.SeedOption = 0,
) -> None:
    """Plan the plate that ships with the project for two heads; leaves files to look at."""
    if folder.exists() and not folder.is_dir():
        raise InputError("is no folder", path=folder, advice="name another with --out")
    folder.mkdir(parents=True, exist_ok=True)
    found = run_team(
        sample_path("plate.gcode.gz"), load_machine("dual-gantry"), TeamSearch(time_limit, seed),
        Rules(),
    )  # fmt: skip
    extras = folder / "plan.json", folder / "report.html", folder / "plate.png"
    with interrupt_stops(), steps() as progress:
        paths = list(found.write_gcode(folder / "plate", report=progress).paths)
        paths += write_extras(found, *extras, None, progress)
    show_team(found, paths, as_json=False)
