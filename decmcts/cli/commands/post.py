"""`decmcts post`: a slicer's post-processing script, editing one file in place.

Any error leaves the file untouched and the exit code non-zero, so that the
slicer aborts its export (PrusaSlicer, OrcaSlicer).
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from decmcts.cli import options as opt
from decmcts.cli.app import app
from decmcts.cli.commands.plan import run_single, show_notes
from decmcts.cli.console import err, out, print_json, steps, summary_of, written
from decmcts.cli.lines import figures, kept_line, whole_file_line
from decmcts.cli.signals import interrupt_stops
from decmcts.errors import InputError
from decmcts.formats.gcode.text.source_text import load_text
from decmcts.formats.gcode.writing.own_header import AsSliced, as_sliced
from decmcts.formats.mesh import is_mesh
from decmcts.planning.options import (
    AvoidWalls,
    Freedom,
    Limits,
    Objective,
    PlannerName,
    ProcessOrder,
    Search,
)
from decmcts.planning.result import Written
from decmcts.planning.writing.lines import layers_line
from decmcts.planning.writing.places import refuse_place, refuse_unwritable


@app.command()
def post(
    path: Annotated[Path, typer.Argument(help="G-code file the slicer hands over")],
    machine: opt.MachineOption = None,
    plate: opt.PlateOption = None,
    planner: opt.PlannerOption = PlannerName.HYBRID,
    freedom: opt.FreedomOption = Freedom.REVERSIBLE,
    seam: opt.SeamOption = None,
    process_order: opt.ProcessOption = ProcessOrder.KEEP,
    objective: opt.ObjectiveOption = Objective.TRAVEL,
    limits: opt.LimitsOption = Limits.SOURCE,
    quality: opt.QualityOption = None,
    min_layer_time: opt.CoolingOption = None,
    max_layers_ahead: opt.LeadOption = None,
    avoid_walls: opt.AvoidOption = AvoidWalls.AUTO,
    time_limit: opt.TimeOption = 30.0,
    seed: opt.SeedOption = 0,
    allow_slower: opt.SlowerOption = False,
    make_safe: opt.MakeSafeOption = False,
    as_json: opt.JsonOption = False,
) -> None:
    """Reorder a G-code file in place, as a slicer's post-processing script."""
    refuse_unwritable([], path)
    refuse_place(path, advice="it is edited in place: make it and its folder writable")
    if is_mesh(path):
        raise InputError("a mesh cannot be edited in place", path=path, advice="use decmcts plan")
    rules = opt.rules_of(
        freedom, seam, process_order, quality, min_layer_time, max_layers_ahead, avoid_walls,
    )  # fmt: skip
    if (before := as_sliced(load_text(path, plate))) is not None:
        with written():
            show_planned_already(before, path, as_json=as_json)
        return
    search = Search(time_limit, seed, planner, objective, certificate=False)
    result = run_single(
        path, machine, search, rules, limits=limits, plate=plate, make_safe=make_safe
    )
    with interrupt_stops() as stop, steps() as told:
        made = result.write_gcode(path, allow_slower=allow_slower, report=told, stop=stop)
    with written():
        show_rewritten(made, path, as_json=as_json)


def show_planned_already(before: AsSliced, path: Path, *, as_json: bool) -> None:
    """Say that a file is a result of ours, which another search would only shuffle."""
    if as_json:
        said = {"input": str(path), "kept_source": True, "planned_already": before.version}
        print_json("decmcts-result/1", {**said, "written": []})
        return
    out.print(
        f"{path}: left as it was; decmcts {before.version} has planned it already "
        "(`decmcts plan` searches on)",
        soft_wrap=True,
    )


def show_rewritten(made: Written, path: Path, *, as_json: bool) -> None:
    """Print the result in one line, for slicers show or log what a script says."""
    result, times = made.result, made.times
    kept = times is not None and times.kept
    if as_json:
        print_json("decmcts-result/1", figures(result, [] if kept else [path], times))
        return
    show_notes(result)
    if times is not None and kept:
        out.print(f"{path}: left as it was; {kept_line(times)}", soft_wrap=True)
        return
    planned = result.planned
    if line := layers_line(planned):
        err.print(line, soft_wrap=True)
    travel = summary_of(planned.before.metrics, planned.after.metrics)["emitted_travel_mm"]
    took = f"; {line}" if (line := whole_file_line(planned, times)) else ""
    out.print(
        f"{path}: rewritten and verified; travel {travel['before']:,.0f} → {travel['after']:,.0f}"
        f" mm ({travel['less_percent']:.1f} % less){took}",
        soft_wrap=True,
    )
