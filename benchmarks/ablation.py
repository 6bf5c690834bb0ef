"""What each part of `hybrid`'s search is worth: without it, at equal time.

    python benchmarks/ablation.py [--time-limit 20] [--settings mk4s-seam] [--seeds 0,1,2]

It is the search that is compared: all but one variant solve nothing exactly. No trees:
greedy start and annealing alone. No local search: trees and a last descent. Γ 0.5: the
paper's, instead of the best of several. One thread: of two.
Writes docs/results/ablation.csv (a row a run, resumable), ablation.md, ablation.png.
"""

from __future__ import annotations

import argparse
import itertools
import statistics
from dataclasses import replace
from pathlib import Path
from typing import Any

from common import (
    Rows,
    arguments,
    grouped,
    markdown,
    median,
    names,
    of_models,
    run_missing,
    setting,
    spread,
)
from in_process import less_percent, searched
from planners import MODELS

from decmcts.search.hybrid.phases import Hybrid
from decmcts.search.hybrid.structure import Trees

SEARCHING = Hybrid(exact=0.0)
VARIANTS = {  # name: (what it says in the table, planner)
    "hybrid": ("hybrid", SEARCHING),
    "exact": ("with exact solutions", Hybrid()),
    "no-trees": ("without trees", replace(SEARCHING, trees=Trees(share=0.0))),
    "no-local": ("without local search", replace(SEARCHING, anneals=False)),
    "gamma-0.5": ("Γ = 0.5", replace(SEARCHING, trees=Trees(gammas=(0.5,)))),
    "one-thread": ("one thread", replace(SEARCHING, threads=1)),
}
KEY = ("model", "machine", "process", "freedom", "variant", "limit_s", "seed")
ROW = ("machine", "freedom", "process", "model")


def run(key: dict[str, Any]) -> dict[str, Any]:
    prepared, result = searched(
        key["model"], key["machine"], key["process"], key["freedom"], VARIANTS[key["variant"]][1],
        limit_s=key["limit_s"], seed=key["seed"],
    )  # fmt: skip
    return key | {
        "contours": len(prepared.job.contours),
        "travel_before_mm": result.source_cost,
        "travel_after_mm": result.cost,
        "less_percent": round(less_percent(result), 2),
        "gamma": result.notes.get("gamma", ""),
        "iterations": result.iterations,
        "error": "",
    }


def table(rows: list[dict[str, str]]) -> tuple[str, dict[str, list[float]]]:
    """Return a line a model, and how much more each variant travels than `hybrid`, in per cent."""
    lines: list[list[str]] = []
    above: dict[str, list[float]] = {name: [] for name in VARIANTS if name != "hybrid"}
    for row, mine in grouped(rows, *ROW).items():
        found = {key[0]: runs for key, runs in grouped(mine, "variant").items()}
        if "hybrid" not in found:
            continue
        ours = median(found["hybrid"], "travel_after_mm")
        gammas = [float(r["gamma"]) for r in found["hybrid"] if r["gamma"]]
        cells = [f"{median(found['hybrid'], 'less_percent'):.2f}"]
        cells.append(" ".join(f"{gamma:g}" for gamma in gammas))
        for name, gaps in above.items():
            if name not in found:
                cells.append("")
                continue
            gaps.append(100 * (median(found[name], "travel_after_mm") / ours - 1) if ours else 0.0)
            cells.append(f"{gaps[-1]:+.2f}")
        lines.append([row[3], f"{row[0]} {row[1]}", mine[0]["contours"], *cells])
    head = ["model", "setting", "contours", "hybrid less %", "Γ chosen"]
    head += [f"{VARIANTS[name][0]}, travel more %" for name in above]
    return markdown(lines, head), above


def summary(above: dict[str, list[float]]) -> str:
    text = ""
    for name, gaps in above.items():
        if gaps:
            better = sum(gap < 0 for gap in gaps)
            text += f"- {VARIANTS[name][0]}: {spread(gaps, 2)} % more travel, mean "
            text += f"{statistics.mean(gaps):.2f}, {min(gaps):.2f} to {max(gaps):.2f} %; less "
            text += f"than `hybrid` in {better} of {len(gaps)} rows\n"
    return text


def plot(above: dict[str, list[float]], path: Path) -> None:
    import matplotlib.pyplot as plt

    there = {name: gaps for name, gaps in above.items() if gaps}
    figure, axis = plt.subplots(figsize=(8, 4.5), layout="constrained")
    axis.axhline(0.0, color="grey")
    axis.boxplot(list(there.values()), tick_labels=[VARIANTS[name][0] for name in there])
    axis.set_yscale("symlog", linthresh=1.0)
    axis.set(ylabel="travel more than hybrid, %")
    axis.grid(axis="y", alpha=0.3)
    figure.savefig(path, dpi=110)


def write_results(rows: list[dict[str, str]], options: argparse.Namespace) -> None:
    mine = [
        r for r in rows
        if float(r["limit_s"]) == options.time_limit and r["process"] == options.process
        and not r["error"]
    ]  # fmt: skip
    seeds = ",".join(sorted({r["seed"] for r in mine}))
    said = setting(
        note=options.note, quality="none", process_order=options.process,
        time_limit=f"{options.time_limit:g} s", seeds=seeds,
    )  # fmt: skip
    lines, above = table(mine)
    settings = ",".join(dict.fromkeys(f"{r['machine']}-{r['freedom']}" for r in mine))
    text = f"# What each part of `hybrid` is worth\n\n{said}\n\nRepeat: "
    text += f"`python benchmarks/ablation.py --settings {settings} --process {options.process} "
    text += f"--time-limit {options.time_limit:g} --seeds {seeds}{of_models(mine, MODELS)}`. "
    text += "`hybrid` is its search alone here, without exact solutions. One thread also "
    text += "means no rival starts, no merging, no races within layers. Of "
    text += "several seeds the median travel counts. The Γ chosen is that of the trees' last "
    text += "turn, seed by seed.\n\n"
    text += summary(above) + "\n![ablation](ablation.png)\n\n" + lines
    (options.results / "ablation.md").write_text(text)
    if any(above.values()):
        plot(above, options.results / "ablation.png")


def main() -> None:
    parser = arguments(__doc__, time_limit=20.0, models=MODELS)
    parser.add_argument("--settings", type=names, default=["paper-reversible", "mk4s-reversible"])
    parser.add_argument("--process", default="keep", choices=["keep", "free"])
    parser.add_argument("--variants", type=names, default=list(VARIANTS))
    options = parser.parse_args()
    rows = Rows(options.results / "ablation.csv", KEY)
    keys = [
        dict(zip(KEY, (model, name.split("-")[0], options.process, name.split("-")[1], variant,
                       options.time_limit, seed), strict=True))
        for name, model, seed, variant in itertools.product(
            options.settings, options.models, options.seeds, options.variants
        )
    ]  # fmt: skip
    if not options.table_only:
        run_missing(rows, keys, run)
    write_results(rows.rows, options)


if __name__ == "__main__":
    main()
