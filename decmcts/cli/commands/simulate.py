"""`decmcts simulate`: finished files, or a plan, run as controllers run them."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from agents.messages.event_stream import stream_of
from decmcts.cli import options as opt
from decmcts.cli.console import err, out, print_json, steps
from decmcts.errors import InputError
from decmcts.formats.plans.plan_json import is_plan
from decmcts.planning.events import Step
from decmcts.planning.simulate import Simulated
from decmcts.planning.simulate import simulate as run
from decmcts.planning.writing.places import (
    put,
    refuse_other_suffixes,
    refuse_stdout,
    refuse_unwritable,
)
from decmcts.print.figures import clock_time
from sim.controllers.motion import QUEUE
from sim.controllers.print_contacts import PrintContact
from sim.controllers.simulate import Simulation, Trial, events_of
from sim.controllers.timing import Timing

TimingOption = Annotated[
    Timing,
    opt.search("--timing", "Errors of time; adversarial: the delays that bring heads nearest"),
]
ErrorOption = Annotated[
    float,
    opt.search(
        "--error SHARE", "How large errors are: 0.2 for 20 % of the time", min=0.0, max=0.99
    ),
]
QueueOption = Annotated[
    int, opt.search("--queue N", "Moves that a controller plans ahead", min=1, max=100_000)
]
MOST_ROWS = 2_000_000
SHOWN = 5  # contacts with the print that are shown in words


@opt.app.command()
def simulate(
    inputs: Annotated[
        list[Path],
        typer.Argument(
            help="PLAN.json, with or without the files of its heads; the files of all heads; "
            "or any one G-code file"
        ),
    ],
    machine: opt.MachineOption = None,
    timing: TimingOption = Timing.NONE,
    error: ErrorOption = 0.2,
    trials: Annotated[
        int, opt.search("--trials N", "How often errors are drawn", min=1, max=100_000)
    ] = 10,
    seed: opt.TimingSeedOption = 0,
    queue: QueueOption = QUEUE,
    events: Annotated[
        Path | None,
        opt.output("--events FILE", "Keep what happens without errors as events (docs/events.md)"),
    ] = None,
    csv: Annotated[Path | None, opt.output("--csv FILE", "Keep where heads are over time")] = None,
    csv_every_s: Annotated[
        float, opt.output("--csv-every-s S", "Seconds between two rows of it", min=0.001, max=1e6)
    ] = 1.0,
    picture: Annotated[
        Path | None,
        opt.output(
            "--picture FILE", "Draw what heads do over time, and how near they come: .png or .svg"
        ),
    ] = None,
    report: opt.ReportOption = None,
    as_json: opt.JsonOption = False,
) -> None:
    """Run files as controllers would; exit code 1 if heads touch anything, or get stuck."""
    refuse_unwritable([events, csv, picture, report], *inputs)
    refuse_other_suffixes(None, report, picture)
    for path, option in ((events, "--events"), (csv, "--csv"), (picture, "--picture")):
        refuse_stdout(path, option)
    if report is not None and not (len(inputs) == 1 and is_plan(inputs[0])):
        raise InputError(
            "a report shows the actions of a plan", advice="run PLAN.json alone with --report"
        )
    with steps() as progress:
        found = run(
            list(inputs), machine, timing=timing, size=error, trials=trials, seed=seed,
            queue=queue, report=progress,
        )  # fmt: skip
        if events is not None:
            progress(Step("writing events"))
            problem = "" if found.plan is None or len(inputs) > 1 else found.plan.problem
            put(stream_of(events_of(found.simulation, problem)), events)
        if csv is not None:
            progress(Step("writing where heads are"))
            put(samples(found, csv_every_s), csv)
        if picture is not None:
            from sim.pictures.run_picture import draw_run  # it loads for those who ask

            progress(Step("drawing"))
            draw_run(picture, found.simulation)
        if report is not None and found.plan is not None:
            from sim.pictures.report import write_run_report  # likewise

            progress(Step("writing the report"))
            log, first = events_of(found.simulation), found.simulation.trials[0]
            write_run_report(
                report, found.plan, log, file=inputs[0].name, contacts=len(first.contacts),
                on_print=touching_print(found, [first]),
            )  # fmt: skip
    if as_json:
        print_json("decmcts-simulation/1", figures(found))
    else:
        show(found)
        for path in (events, csv, picture, report):
            if path is not None:
                out.show(f"wrote {path}")
    if not found.simulation.safe:
        raise typer.Exit(1)


def samples(found: Simulated, every_s: float) -> bytes:
    """Return where heads are over time as CSV; InputError for more rows than anyone reads."""
    simulation = found.simulation
    end = simulation.makespan_s
    end = end if math.isfinite(end) else 0.0
    if end / every_s > MOST_ROWS:
        raise InputError(
            f"{end / every_s:,.0f} rows are more than {MOST_ROWS:,}",
            advice=f"say --csv-every-s {end / MOST_ROWS:.3g} or more",
        )
    times = np.arange(0.0, end + every_s / 2, every_s)
    names = [f"{p.name}_{axis}_mm" for p in simulation.programs for axis in "xyz"]
    text = io.StringIO()
    rows = np.column_stack([times, *simulation.positions(times)])
    np.savetxt(text, rows, "%.3f", ",", header=",".join(["time_s", *names]), comments="")
    return text.getvalue().encode()


def figures(found: Simulated) -> dict[str, Any]:
    """Return what `--json` prints."""
    simulation = found.simulation
    names = [head.name for head in simulation.heads]
    return {
        "makespan_s": simulation.makespan_s,
        "planned_s": found.planned_s,
        "set_up_s": simulation.begin_s,
        "safe": simulation.safe,
        "heads": [asdict(head) for head in simulation.heads],
        "waits": [
            {**asdict(w), "head": names[w.head], "by": names[w.by],
             "begin_s": w.begin_s - simulation.begin_s}
            for w in simulation.waits if w.begin_s >= simulation.begin_s
        ],
        "trials": [_of_trial(trial, names, simulation.begin_s) for trial in simulation.trials],
    }  # fmt: skip


def _of_trial(trial: Trial, names: list[str], zero: float) -> dict[str, Any]:
    return {
        "name": trial.name,
        "makespan_s": trial.makespan_s,
        "waits_for_ever": [names[h] for h, _ in trial.stuck],
        "too_soon": len(trial.too_soon),
        "too_soon_s": max((each.due_s - each.gap_s for each in trial.too_soon), default=0.0),
        "nearest": [
            {"heads": [names[h] for h in near.heads], "gap_mm": near.gap_mm,
             "rail_mm": near.rail_mm, "time_s": near.time_s - zero, "at": near.at}
            for near in trial.near
        ],
        "contacts": [
            {**asdict(c), "heads": [names[h] for h in c.heads], "time_s": c.time_s - zero}
            for c in trial.contacts
        ],
        "print_contacts": [
            {**asdict(c), "head": names[c.head], "time_s": c.time_s - zero,
             "by": names[c.by] if c.by >= 0 else None}
            for c in trial.on_print
        ],
    }  # fmt: skip


def show(found: Simulated) -> None:
    """Print a table of heads, and how near they came."""
    simulation = found.simulation
    end, plan = simulation.makespan_s, found.planned_s
    ends = clock_time(end) if math.isfinite(end) else "never: heads wait for one another"
    beside = ""
    if plan and math.isfinite(end):
        beside = f", {abs(end - plan) / plan:.2%} {'more' if end > plan else 'less'} than planned"
    out.show(f"print time {ends}{beside}")
    if simulation.begin_s > 0.0 and len(simulation.programs) > 1:
        out.print(f"before it, heads heat and are set up for {clock_time(simulation.begin_s)}")
    table = Table(show_edge=False, pad_edge=False)
    for name in ("head", "prints", "travels", "waits", "stands", "filament", "rests in beads"):
        table.add_column(name, justify="left" if name == "head" else "right")
    for head in simulation.heads:
        shares = (head.printing_s, head.travelling_s, head.waiting_s, head.standing_s)
        table.add_row(
            head.name, *(f"{share / end:.1%}" if end > 0 else "" for share in shares),
            f"{head.filament_mm:,.0f} mm", str(head.rests_in_beads),
        )  # fmt: skip
    out.print(table)
    out.show(*nearest_lines(found))


def nearest_lines(found: Simulated) -> list[str]:
    """Return how near heads came in all trials, longest waits, and what went wrong."""
    simulation = found.simulation
    names = [head.name for head in simulation.heads]
    lines = []
    for k, pair in enumerate(near.heads for near in simulation.trials[0].near):
        nearest = min((trial.near[k] for trial in simulation.trials), key=lambda near: near.gap_mm)
        rail = round(min(trial.near[k].rail_mm for trial in simulation.trials), 2) + 0.0  # no -0
        which = " and ".join(names[h] for h in pair)
        if math.isfinite(nearest.gap_mm):
            lines.append(f"{which}: {nearest.gap_mm:.2f} mm apart at least")
        if math.isfinite(rail):
            lines.append(f"{which}: {rail:.2f} mm more than the rail keeps them apart, at least")
    longest = max(simulation.waits, key=lambda wait: wait.seconds, default=None)
    if longest is not None and longest.begin_s >= simulation.begin_s:
        at = clock_time(longest.begin_s - simulation.begin_s)
        lines.append(
            f"longest wait: {names[longest.head]} for {names[longest.by]}, "
            f"{longest.seconds:.1f} s at {at}"
        )
    ends = [trial.makespan_s for trial in simulation.trials[1:] if math.isfinite(trial.makespan_s)]
    if ends:
        lines.append(
            f"with errors of time, {len(ends)} times: print time {clock_time(min(ends))} to "
            f"{clock_time(max(ends))}"
        )
    if found.cools:
        lines.append(cooling_line(simulation))
    touch = simulation.contacts
    if len(names) > 1:
        lines.append(f"{touch} contact{'s' * (touch != 1)} of heads")
    lines += print_contact_lines(found)
    stuck = {names[h] for trial in simulation.trials for h, _ in trial.stuck}
    if stuck:
        lines.append(f"waits for ever: {', '.join(sorted(stuck))}")
    if touch:
        err.show("heads touch: these files must not be run together")
    if simulation.print_contacts:
        err.show("a head touches the print: this must not be run")
    return lines


def print_contact_lines(found: Simulated) -> list[str]:
    """Return how often heads touched the print, and of the first times when, where and what."""
    if not found.looked_at_print:
        return ["contacts with the print are not looked for: no shape of the head is known"]
    touch = found.simulation.print_contacts
    lines = touching_print(found, found.simulation.trials)
    return [f"{touch} contact{'s' * (touch != 1)} with the print", *(f"  {x}" for x in lines)]


def touching_print(found: Simulated, trials: Sequence[Trial]) -> list[str]:
    """Return the first contacts of heads with the print in words, and how many more there are."""
    every = [one for trial in trials for one in trial.on_print]
    lines = [print_contact_line(found, one) for one in every[:SHOWN]]
    return [*lines, f"and {len(every) - SHOWN} more"] if len(every) > SHOWN else lines


def print_contact_line(found: Simulated, one: PrintContact) -> str:
    """Return one contact in words."""
    names = [head.name for head in found.simulation.heads]
    at, zero = ", ".join(f"{value:.2f}" for value in one.at), found.simulation.begin_s
    does = f"prints contour {one.contour}" if one.contour >= 0 else "travels"
    does = f"is at line {one.line}" if one.line else does
    met = f"contour {one.bead}" if one.bead >= 0 else "what stood there before"
    met = f"the bead of line {one.bead_line}" if one.bead_line else met
    if one.by >= 0 and len(names) > 1:
        met += f" of {names[one.by]}"
    return (
        f"{clock_time(one.time_s - zero)}: {names[one.head]} {does}, its {one.part} goes "
        f"{one.depth_mm:.2f} mm into {met}, nozzle at ({at})"
    )


def cooling_line(simulation: Simulation) -> str:
    """Return how often, and by how much, spots were printed over too soon."""
    trials = simulation.trials
    short = [each.due_s - each.gap_s for trial in trials for each in trial.too_soon]
    if not short:
        return f"no spot is printed over too soon in {len(trials)} run{'s' * (len(trials) > 1)}"
    broken = sum(bool(trial.too_soon) for trial in trials)
    return (
        f"printed over too soon: {len(short):,} contours in {broken} of {len(trials)} runs, by "
        f"{max(short):.1f} s at most"
    )
