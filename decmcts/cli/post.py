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
from decmcts.cli.outputs import write_single
from decmcts.cli.plan import run_single, seam_of, show
from decmcts.cli.quality import Quality
from decmcts.errors import InputError
from decmcts.formats.mesh import MESH_SUFFIXES, SliceOptions


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
) -> None:
    """Reorder a G-code file in place, as a slicer's post-processing script."""
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
        slicing=SliceOptions(),
        quiet=False,
    )
    times = write_single(planned, path)
    show(planned, [path], times, as_json=False)
