"""`decmcts launch`, `agent` and `demo`: several heads, each its own process."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.live import Live

from agents import extruder
from agents.launch import LaunchResult
from agents.launch import launch as launch_agents
from agents.supervisor import AgentStatus, LaunchError
from decmcts._kernels.engine.lags import Lags
from decmcts.cli import options as opt
from decmcts.cli import qcsp
from decmcts.cli.ahead import TEAM, compilation_announced, compiling_beside, finish_beside
from decmcts.cli.app import app
from decmcts.cli.console import err, gain_table, out, print_json, steps, written
from decmcts.cli.first_check import refuse_unsound
from decmcts.cli.joint import TeamSearch, best_of
from decmcts.cli.outputs import (
    figures,
    head_files,
    is_longer,
    refuse_other_suffixes,
    refuse_unwritable,
    stem_of,
    write_extras,
    write_heads,
)
from decmcts.cli.pipeline import (
    Loaded,
    Planned,
    check,
    load,
    named,
    search,
    source_plan,
)
from decmcts.cli.plan import ONLY_SHOWN, seam_of
from decmcts.cli.quality import Quality, cooling_line
from decmcts.cli.record import agents_table, recording
from decmcts.cli.signals import interrupt_stops
from decmcts.errors import InputError
from decmcts.formats.gcode import refuse_for_heads, unprimed_note
from decmcts.formats.machine_file import load_machine
from decmcts.formats.mesh import SliceOptions
from decmcts.formats.qcsp import is_qcsp
from decmcts.formats.reading import read_toml
from decmcts.print.job import PrintJob
from decmcts.print.plan import PlanDocument
from decmcts.team.bounds.makespan import Bound, makespan_bound
from decmcts.team.dec_mcts.parameters import Parameters, changed
from decmcts.team.engine.space import eligibility, refuse_shut_in
from decmcts.team.schedule.cooling import cooled, find_lags, print_times
from decmcts.team.schedule.entries import Orders, agreed_job, entries_of, first_entries
from decmcts.team.schedule.leaning import lean

StemOption = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--output",
        rich_help_panel=opt.BASICS,
        metavar="STEM",
        help="Stem of the G-code files, one a head; of a .qcsp, the schedule's file",
    ),
]
HeadsOption = Annotated[
    str,
    typer.Option(
        "--machine", rich_help_panel=opt.BASICS, metavar="NAME|FILE", help="A machine with heads"
    ),
]

RecordOption = Annotated[
    Path | None,
    typer.Option(
        "--record",
        rich_help_panel=opt.OUTPUT,
        metavar="FILE",
        help="Keep what the heads do as they plan, for `decmcts replay`",
    ),
]
TeamOption = Annotated[
    Path | None,
    typer.Option(
        "--team",
        rich_help_panel=opt.SEARCH,
        metavar="FILE",
        help="Parameters of the heads' search, a TOML file (docs/team.md)",
    ),
]


TeamObjectiveOption = Annotated[
    opt.Objective,
    typer.Option(
        "--objective",
        rich_help_panel=opt.SEARCH,
        help="The makespan comes first; this is what one head's own order and the points "
        "contours are entered at save: travel (mm) or time",
    ),
]


@app.command()
def launch(
    context: typer.Context,
    source: opt.Input,
    output: StemOption = None,
    machine: HeadsOption = "dual-gantry",
    freedom: opt.FreedomOption = opt.Freedom.REVERSIBLE,
    seam: opt.SeamOption = None,
    process_order: opt.ProcessOption = opt.ProcessOrder.KEEP,
    objective: TeamObjectiveOption = opt.Objective.TRAVEL,
    limits: opt.LimitsOption = opt.Limits.SOURCE,
    quality: opt.QualityOption = None,
    min_layer_time: opt.CoolingOption = None,
    max_layers_ahead: opt.LeadOption = None,
    time_limit: opt.TimeOption = 30.0,
    seed: opt.SeedOption = 0,
    team: TeamOption = None,
    plan_file: opt.PlanOption = None,
    report: opt.ReportOption = None,
    picture: opt.PictureOption = None,
    record: RecordOption = None,
    as_json: opt.JsonOption = False,
) -> None:
    """Plan for several heads: one process each, agreeing on one joint plan; or solve a QCSP."""
    if is_qcsp(source):
        qcsp.refuse_for_qcsp(context)
        qcsp.launch_qcsp(source, output, time_limit_s=time_limit, seed=seed, as_json=as_json)
        return
    orders = Orders(freedom.value, seam_of(freedom, seam), objective.value)
    stem = None if output is None else stem_of(output)
    heads = [] if stem is None else head_files(stem, load_machine(machine))
    outputs = [*heads, plan_file, report, picture, record]
    refuse_unwritable(outputs, source, *([] if team is None else [team]))
    refuse_other_suffixes(plan_file, report, picture)
    only_shown = not (as_json or stem or plan_file or report or picture or record)
    parameters = {} if team is None else read_parameters(team)
    planned = run_team(
        source,
        machine,
        process_order=process_order.value,
        own_limits=limits == opt.Limits.SOURCE,
        quality=Quality(quality, min_layer_time, max_layers_ahead),
        asked=TeamSearch(time_limit, seed, parameters, record, orders),
        writes=stem is not None,
        remark=ONLY_SHOWN if only_shown else "",
    )
    with interrupt_stops(), steps() as (announce, _):  # a first Ctrl-C lets everything be written
        announce("writing files")
        paths = [] if stem is None else write_heads(planned, stem)
        paths += write_extras(planned, plan=plan_file, report=report, picture=picture)
    with written():
        show_team(planned, paths, as_json=as_json)
        if only_shown:
            err.print("nothing was written; `-o STEM` writes the files of all heads")


def read_parameters(path: Path) -> Mapping[str, Any]:
    """Return the parameters that a file sets; raises InputError for what is not allowed."""
    values = read_toml(path, "file of parameters", page="docs/team.md")
    changed(Parameters(), values, path=path)
    return values


def run_team(
    source: Path,
    machine: str,
    *,
    process_order: str,
    quality: Quality,
    asked: TeamSearch,
    own_limits: bool = True,
    writes: bool = True,
    remark: str = "",
) -> Planned:
    """Load, let the agents plan and agree, schedule, verify.

    With `writes` what no head's file could hold is refused before the search, and noted what
    it leaves out; the `remark` is made once the input is known to be of use.
    """
    with (
        steps() as (said, _),
        compilation_announced(said) as announce,
        compiling_beside([TEAM]),
    ):
        loaded = load(
            source,
            machine,
            process_order=process_order,
            quality=quality,
            options=_slicing(),
            announce=announce,
            own_limits=own_limits,
            freedom=asked.orders.freedom,
        )
        announce("the source's own order, one head")
        before = source_plan(loaded)
        if writes:
            refuse_for_heads(loaded.document, loaded.job, loaded.machine)
            loaded = with_note(loaded, unprimed_note(loaded.document))
        with named(loaded.path):
            refuse_shut_in(loaded.job, loaded.machine)
        refuse_unsound(loaded, before, writes=False)
        if remark:
            err.print(remark, soft_wrap=True)
        lags = lags_of(loaded, before)
        announce("what one head alone reaches")
        order = search(
            loaded,
            planner="local",
            freedom=asked.orders.freedom,
            seam=asked.orders.seam,
            objective=asked.orders.objective,
            time_limit_s=min(10.0, asked.time_limit_s / 3),
            seed=asked.seed,
        ).toolpath
        order = cooled(loaded.job, loaded.machine, loaded.graph, lags, order).toolpath
        entry = first_entries(loaded.job, asked.orders, order)
        entries = entries_of(loaded.job, asked.orders)
        if entries is not None:
            announce("where loops begin")
        entry = lean(loaded.job, loaded.machine, loaded.graph, asked.orders, entry, entries, lags)
        announce("a bound on the makespan")
        bound = makespan_bound(loaded.job, loaded.machine, loaded.graph, entries=entries)
        finish_beside(TEAM, announce)  # else every agent would load what others compile
    started = time.perf_counter()
    job = agreed_job(loaded.job, asked.orders, entry)
    result = _agreed(loaded, job, lags, bound, asked)
    seconds = {**loaded.seconds, "plan": time.perf_counter() - started}
    with steps() as (announce, _):
        announce("safe travels, times and order across heads")
        after = best_of(loaded, lags, result, order, entry, bound, asked)
        history = [] if result is None else _history(result)
        return check(loaded, before, after, history, seconds, announce)


def with_note(loaded: Loaded, note: str | None) -> Loaded:
    """Return what was loaded with one more note on the source, if there is one."""
    if note is None:
        return loaded
    return replace(loaded, job=replace(loaded.job, notes=(*loaded.job.notes, note)))


def lags_of(loaded: Loaded, before: PlanDocument) -> Lags:
    """Return how long what is printed over must cool, by the source's own times."""
    times = print_times(before.plan.heads[0], len(loaded.job.contours))
    return find_lags(loaded.job.contours, [times], loaded.min_layer_time_s)[0]


def _agreed(
    loaded: Loaded, job: PrintJob, lags: Lags, bound: Bound, asked: TeamSearch
) -> LaunchResult | None:
    """Return what the agents agreed on, or None: one head alone is always left."""
    try:
        result = _planned_by_agents(loaded, job, lags, bound, asked)
    except LaunchError as error:
        err.print(f"{error}; one head prints alone", markup=False)
        return None
    for lost in (a for a in result.agreement.agents if a.phase == "lost"):
        err.print(f"head {lost.name} was lost ({lost.note}); the plan does without it")
    return result


def _slicing() -> SliceOptions:
    return SliceOptions(center=(150.0, 150.0))


def _planned_by_agents(
    loaded: Loaded, job: PrintJob, lags: Lags, bound: Bound, asked: TeamSearch
) -> LaunchResult:
    """Run the agents with a live table of what each is doing."""
    with (
        interrupt_stops() as stopped,
        recording(asked.record, bound.bound_s) as keep,
        Live(console=err, transient=True, refresh_per_second=4) as live,
    ):

        def show(agents: tuple[AgentStatus, ...]) -> None:
            live.update(agents_table(agents, bound.bound_s))
            keep(agents)

        return launch_agents(
            job,
            loaded.machine,
            loaded.graph,
            time_limit_s=asked.time_limit_s,
            seed=asked.seed,
            lags=lags,
            parameters=asked.parameters,
            on_progress=show,
            should_stop=stopped,
        )


def _history(result: LaunchResult) -> list[tuple[float, float]]:
    """Return the best makespan of any agent over time."""
    best, history = float("inf"), []
    for seconds, makespan in sorted(h for a in result.agreement.agents for h in a.history):
        if makespan < best:
            best = makespan
            history.append((seconds, makespan))
    return history


def show_team(planned: Planned, paths: list[Path], *, as_json: bool) -> None:
    """Print the summary of a joint plan."""
    before, after = planned.before.metrics, planned.after.metrics
    if as_json:
        print_json("decmcts-result/1", figures(planned, paths))
        return
    for note in planned.loaded.job.notes:
        err.print(note, soft_wrap=True)
    title = (
        f"{planned.loaded.path.name}: machine {planned.after.machine.name}, "
        f"planner {after['planner']}, seed {after['seed']}, verified"
    )
    out.print(title, soft_wrap=True)
    out.print(gain_table(before, after))
    ratio = after["one_head_s"] / after["makespan_s"]
    over = after["makespan_s"] / after["bound"]["bound_s"]
    out.print(
        f"{ratio:.2f}x as fast as one head alone ({after['one_head_s']:,.0f} s, local search); "
        f"{over:.2f} times the proven bound ({after['bound']['bound_s']:,.0f} s)"
    )
    if line := cooling_line(planned.after):
        out.print(line, soft_wrap=True)
    if is_longer(before["makespan_s"], after["makespan_s"]):
        own = f"the source's own order ({before['makespan_s']:,.0f} s)"
        whole = eligibility(planned.loaded.job.contours, planned.loaded.machine.heads).all(axis=0)
        out.print(
            f"longer than one head in {own}: print the source"
            if whole.any()
            else f"longer than one head in {own}, but none reaches all of it",
            soft_wrap=True,
        )
    for path in paths:
        out.print(f"wrote {path}", soft_wrap=True)


@app.command(
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
    add_help_option=False,
)
def agent(context: typer.Context) -> None:
    """Run one head's agent (what `launch` starts; `decmcts agent --help` for its options)."""
    raise typer.Exit(extruder.main(context.args))


@app.command()
def demo(
    folder: Annotated[
        Path,
        typer.Option(
            "--out", metavar="FOLDER", help="Folder for the results", rich_help_panel=opt.BASICS
        ),
    ] = Path("out"),
    time_limit: opt.TimeOption = 15.0,
    seed: opt.SeedOption = 0,
) -> None:
    """Plan the plate that ships with the project for two heads; leaves files to look at."""
    from decmcts.samples import sample_path
    from sim.pictures.drawings import draw_gantt

    if folder.exists() and not folder.is_dir():
        raise InputError("is no folder", path=folder, advice="name another with --out")
    folder.mkdir(parents=True, exist_ok=True)
    planned = run_team(
        sample_path("plate.gcode.gz"),
        "dual-gantry",
        process_order="keep",
        quality=Quality(),
        asked=TeamSearch(time_limit, seed),
    )
    paths = write_heads(planned, folder / "plate")
    paths += write_extras(
        planned,
        plan=folder / "plan.json",
        report=folder / "report.html",
        picture=folder / "plate.png",
    )
    draw_gantt(folder / "gantt.png", planned.after)
    show_team(planned, [*paths, folder / "gantt.png"], as_json=False)
