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
from decmcts.cli.console import err, out, print_json, steps, summary_of, written
from decmcts.cli.no_slower import kept_line, write_no_slower
from decmcts.cli.outputs import FileTimes, figures, layers_line, refuse_unwritable, whole_file_line
from decmcts.cli.pipeline import Planned
from decmcts.cli.plan import run_single, seam_of, show_notes
from decmcts.cli.quality import Quality
from decmcts.cli.signals import interrupt_stops
from decmcts.errors import InputError
from decmcts.formats.mesh import MESH_SUFFIXES


@app.command()
def post(
    path: Annotated[Path, typer.Argument(help="G-code file the slicer hands over")],
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
    as_json: opt.JsonOption = False,
) -> None:
    """Reorder a G-code file in place, as a slicer's post-processing script."""
    refuse_unwritable([], path)
    if path.suffix.lower() in MESH_SUFFIXES:
        raise InputError("a mesh cannot be edited in place", path=path, advice="use decmcts plan")
    planned = run_single(
        path,
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
    )
    with interrupt_stops() as stop, steps() as (announce, _):
        planned, times = write_no_slower(
            planned, path, announce, allow_slower=allow_slower, stop=stop
        )
    with written():
        show_rewritten(planned, path, times, as_json=as_json)


def show_rewritten(planned: Planned, path: Path, times: FileTimes, *, as_json: bool) -> None:
    """Print the result in one line, for slicers show or log what a script says."""
    if as_json:
        print_json("decmcts-result/1", figures(planned, [] if times.kept else [path], times))
        return
    show_notes(planned)
    if times.kept:
        out.print(f"{path}: left as it was; {kept_line(times)}", soft_wrap=True)
        return
    if line := layers_line(planned):
        err.print(line, soft_wrap=True)
    travel = summary_of(planned.before.metrics, planned.after.metrics)["emitted_travel_mm"]
    took = f"; {line}" if (line := whole_file_line(planned, times)) else ""
    out.print(
        f"{path}: rewritten and verified; travel {travel['before']:,.0f} → {travel['after']:,.0f}"
        f" mm ({travel['less_percent']:.1f} % less){took}",
        soft_wrap=True,
    )
