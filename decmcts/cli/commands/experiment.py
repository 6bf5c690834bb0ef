"""`decmcts experiment`: questions answered by runs, from a name to a table and a figure."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from decmcts.cli import options as opt
from decmcts.cli.app import app
from decmcts.cli.console import out, steps
from decmcts.experiments.catalogue import EXPERIMENTS
from decmcts.experiments.cluster import cluster_at
from decmcts.experiments.run import experiment as run_experiment

NameArgument = Annotated[str | None, typer.Argument(help="Which one; without it all are listed")]
FolderOption = Annotated[
    Path,
    opt.basics(
        "-o --output FOLDER",
        "Gets NAME.csv, NAME.md and NAME.png; rows that are there are not computed again",
    ),
]
FullOption = Annotated[bool, opt.basics("--full", "All of it, hours; else a minute or two")]
PrintsOption = Annotated[
    Path | None,
    opt.basics("--prints FOLDER", "G-code of your own, in place of prints made by code"),
]
LimitOption = Annotated[
    float | None, opt.search("--time-limit S", "Processor time of each search", min=0.0)
]
IterationsOption = Annotated[
    int | None,
    opt.search(
        "--iterations N",
        "Rounds of each search in place of seconds: equal rows on every computer",
        min=1,
    ),
]
SeedsOption = Annotated[int | None, opt.search("--seeds N", "How many seeds", min=1)]
JobsOption = Annotated[int | None, opt.search("--jobs N", "Processes; default: one a core", min=1)]
ClusterOption = Annotated[
    str | None,
    opt.search("--cluster ADDRESS", "Scheduler of a Dask cluster that computes the rows"),
]


@app.command()
def experiment(
    name: NameArgument = None,
    folder: FolderOption = Path(),
    full: FullOption = False,
    prints: PrintsOption = None,
    time_limit: LimitOption = None,
    iterations: IterationsOption = None,
    seeds: SeedsOption = None,
    jobs: JobsOption = None,
    cluster: ClusterOption = None,
) -> None:
    """Run an experiment that comes with the program; exit code 1 if some of its runs failed."""
    if name is None:
        for each in EXPERIMENTS.values():
            out.show(f"{each.name:22}{each.question}")
        return
    by = nullcontext(None) if cluster is None else cluster_at(cluster)
    with steps() as told, by as executor:
        found = run_experiment(
            name, folder, full=full, prints=prints, time_limit_s=time_limit,
            iterations=iterations, seeds=seeds, jobs=jobs, executor=executor, report=told,
        )  # fmt: skip
    out.show(found.page)
    for path in found.paths:
        out.show(f"wrote {path}")
    if found.failed:
        raise typer.Exit(1)
