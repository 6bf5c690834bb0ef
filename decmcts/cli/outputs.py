"""Writes what was asked for, only after verification, each file atomically."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from decmcts import __version__
from decmcts.cli.pipeline import Planned
from decmcts.errors import InputError
from decmcts.formats.gcode import write_gcode, write_head_gcode
from decmcts.formats.plan_json import write_plan
from sim.pictures import draw_plan
from sim.report import write_report


def refuse_unwritable(paths: list[Path | None], source: Path) -> None:
    """Fail before the long work: each output needs an existing folder we may write to."""
    for path in paths:
        if path is None:
            continue
        folder = path.parent if str(path.parent) else Path()
        if not folder.is_dir():
            raise InputError(
                "no such folder", path=folder, advice="make it, or name another output"
            )
        if path.is_dir():
            raise InputError("the output is a folder", path=path, advice="name a file")
        if not os.access(folder, os.W_OK) or (path.exists() and not os.access(path, os.W_OK)):
            raise InputError("cannot write here", path=path, advice="name another output")
        if path.exists() and source.exists() and path.samefile(source):
            raise InputError(
                "the output is the input",
                path=path,
                advice="name another file, or use `decmcts post` to edit in place",
            )


def bare(metrics: dict[str, Any]) -> float:
    """Return the paper's metric out of a plan's metrics."""
    return float(metrics["extrusionless_travel_mm"])


def header_lines(planned: Planned) -> list[str]:
    """Return the comment lines that say what was done to the file."""
    was, now = planned.before.metrics, planned.after.metrics
    machine = planned.after.machine
    return [
        f"reordered by decmcts {__version__} for machine {machine.name}",
        f"planner {now['planner']}, freedom {now['freedom']}, seed {now['seed']}",
        f"extrusionless travel {bare(was):.1f} mm -> {bare(now):.1f} mm",
        f"estimated print time {was['print_time_s']:.0f} s -> {now['print_time_s']:.0f} s",
        "verified: every extrusion exactly once, no contact of head and print",
    ]


def write_single(planned: Planned, path: Path) -> None:
    """Write the reordered G-code of a one-head plan."""
    loaded = planned.loaded
    write_gcode(
        loaded.document,
        loaded.job,
        planned.after.plan.heads[0],
        path,
        header_lines=header_lines(planned),
    )


def write_heads(planned: Planned, stem: Path) -> list[Path]:
    """Write one G-code file per head, `STEM_HEAD.gcode`; returns the paths."""
    loaded = planned.loaded
    paths = []
    for index, head in enumerate(planned.after.plan.heads):
        path = stem.with_name(f"{stem.name}_{head.head}.gcode")
        write_head_gcode(
            loaded.document,
            loaded.job,
            planned.after.plan,
            index,
            path,
            header_lines=header_lines(planned),
            park=planned.loaded.machine.heads[index].park,
        )
        paths.append(path)
    return paths


def write_extras(
    planned: Planned, *, plan: Path | None, report: Path | None, picture: Path | None
) -> list[Path]:
    """Write plan.json, report and picture where asked; returns what was written."""
    written: list[Path] = []
    if plan is not None:
        write_plan(planned.after, plan)
        written.append(plan)
    if report is not None:
        write_report(report, before=planned.before, after=planned.after, history=planned.history)
        written.append(report)
    if picture is not None:
        draw_plan(picture, planned.before, planned.after)
        written.append(picture)
    return written


def figures(planned: Planned) -> dict[str, Any]:
    """Return what `--json` prints of a result."""
    loaded = planned.loaded
    return {
        "input": str(loaded.path),
        "machine": loaded.machine.name,
        "slicer": loaded.job.slicer,
        "edges": loaded.graph.n_edges,
        "barriers": [f"{b.text} (line {b.line}): {b.reason}" for b in loaded.job.barriers],
        "notes": list(loaded.job.notes),
        "seconds": {name: round(value, 3) for name, value in planned.seconds.items()},
        "before": planned.before.metrics,
        "after": planned.after.metrics,
        "verified": True,
    }
