"""`decmcts experiment`: questions answered by runs, from a name to a table and a figure."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from decmcts.cli import options as opt
from decmcts.cli.console import out, steps
from decmcts.experiments.run import EXPERIMENTS, cluster_at
from decmcts.experiments.run import experiment as run_experiment


@opt.app.command()
def experiment(
    name: Annotated[str | None, typer.Argument(help="Which one; without it all are listed")] = None,
    folder: Annotated[
        Path,
        opt.basics(
            "-o --output FOLDER",
            "Gets NAME.csv, NAME.md and NAME.png; rows that are there are not computed again",
        ),
    ] = Path(),
    full: Annotated[bool, opt.basics("--full", "All of it, hours; else a minute or two")] = False,
    prints: Annotated[
        Path | None,
        opt.basics("--prints FOLDER", "G-code of your own, in place of prints made by code"),
    ] = None,
    time_limit: Annotated[
        float | None, opt.search("--time-limit S", "Processor time of each search", min=0.0)
    ] = None,
    iterations: Annotated[
        int | None,
        opt.search(
            "--iterations N",
            "Rounds of each search in place of seconds: equal rows on every computer",
            min=1,
        ),
    ] = None,
    seeds: Annotated[int | None, opt.search("--seeds N", "How many seeds", min=1)] = None,
    jobs: Annotated[
        int | None, opt.search("--jobs N", "Processes; default: one a core", min=1)
    ] = None,
    cluster: Annotated[
        str | None,
        opt.search("--cluster ADDRESS", "Scheduler of a Dask cluster that computes the rows"),
    ] = None,
) -> None:
    """Run an experiment that comes with the program; exit code 1 if some of its runs failed."""
    if name is None:
        for each in EXPERIMENTS.values():
            out.show(f"{each.name:22}{each.question}")
        return
    by = nullcontext(None) if cluster is None else cluster_at(cluster)
    with steps() as progress, by as executor:
        found = run_experiment(
            name, folder, full=full, prints=prints, time_limit_s=time_limit,
            iterations=iterations, seeds=seeds, jobs=jobs, executor=executor, report=progress,
        )  # fmt: skip
    out.show(found.page)
    for path in found.paths:
        out.show(f"wrote {path}")
    if found.failed:
        raise typer.Exit(1)
