"""All 63 models, one head: what is gained, and contours, edges, seconds and memory.

    python benchmarks/models.py [--machines paper,mk4s] [--freedoms reversible,seam]
    python benchmarks/models.py --planners local,mcts --machines paper --jobs 2

The second command adds the planners of the paper's figure. Writes
docs/results/models.csv (a row a run, resumable), models.md, models.png (growth)
and reductions.png (box plot).
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from common import (
    CPU_TIME,
    Rows,
    arguments,
    corpus,
    grouped,
    in_groups,
    markdown,
    measured,
    names,
    print_path,
    run_missing,
    setting,
    spread,
)

WHOLE = ("file_time_s", "retractions", "travel_over_walls_mm")  # of whole files
STEPS = ("read", "graph", "plan", "verify", "write")
KEY = ("model", "machine", "process", "freedom", "planner", "limit_s", "seed")
ORDER = "slicer layerwise greedy local mcts hybrid"  # of the planners in tables and plots


def run(path: Path, key: dict[str, Any], *, write: bool = True) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        arguments = ["plan", str(path), "--machine", key["machine"]]
        arguments += ["-o", f"{folder}/out.gcode", "--allow-slower"] if write else []
        arguments += ["--planner", key["planner"], "--time-limit", str(key["limit_s"])]
        arguments += ["--freedom", key["freedom"], "--process-order", key["process"]]
        arguments += ["--seam", "nearest"] if key["freedom"] == "seam" else []
        arguments += ["--no-quality"]  # `free` is geometry only; what quality costs: quality.py
        arguments += ["--no-certificate", "--seed", str(key["seed"])]  # bounds: certificates.py
        timeout_s = 1800.0 + 8.0 * float(key["limit_s"])
        result = measured(arguments, timeout_s=timeout_s, cpu_time=True)
    return {**key, **figures_of(result)}


def run_key(key: dict[str, Any]) -> dict[str, Any]:
    return run(print_path(key["model"]), key)


def figures_of(result: dict[str, Any]) -> dict[str, Any]:
    seconds = result.get("seconds", {})
    before, after = result.get("before", {}), result.get("after", {})
    gain = 0.0
    if before.get("extrusionless_travel_mm"):
        gain = 100 * (1 - after["extrusionless_travel_mm"] / before["extrusionless_travel_mm"])
    return {
        "contours": after.get("contours", ""),
        "edges": result.get("edges", ""),
        **{
            f"{name}_s": seconds.get(name, "")
            for name in ("read", "graph", "plan", "verify", "write")
        },
        "peak_mib": round(result["peak_mib"]),
        "travel_before_mm": before.get("extrusionless_travel_mm", ""),
        "travel_after_mm": after.get("extrusionless_travel_mm", ""),
        "less_percent": round(gain, 2),
        "emitted_before_mm": before.get("emitted_travel_mm", ""),
        "emitted_after_mm": after.get("emitted_travel_mm", ""),
        "time_before_s": before.get("print_time_s", ""),
        "time_after_s": after.get("print_time_s", ""),
        **{f"{key}_before": before.get(key, "") for key in WHOLE},
        **{f"{key}_after": after.get(key, "") for key in WHOLE},
        "verified": result.get("verified", False),
        "error": result.get("error", ""),
    }


def table(rows: list[dict[str, str]]) -> str:
    head = ["model", "machine", "freedom", "contours", "edges", "read s", "graph s", "plan s",
            "verify s", "write s", "peak MiB", "travel before mm", "after mm", "less %",
            "emitted less %", "time less %", "whole file s", "retractions", "over outer walls mm",
            "verified"]  # fmt: skip
    lines = []
    for r in rows:
        emitted = 100 * (1 - float(r["emitted_after_mm"]) / float(r["emitted_before_mm"]))
        lines.append(
            [r["model"], r["machine"], r["freedom"], r["contours"], r["edges"]]
            + [f"{float(r[f'{s}_s']):.2f}" for s in STEPS]
            + [r["peak_mib"], f"{float(r['travel_before_mm']):.0f}"]
            + [f"{float(r['travel_after_mm']):.0f}", f"{float(r['less_percent']):.1f}"]
            + [f"{emitted:.1f}", f"{time_saved(r):.1f}", *(arrow(r, key) for key in WHOLE)]
            + ["yes" if r["verified"] == "True" else "NO"]
        )
    return markdown(lines, head)


def arrow(row: dict[str, str], key: str) -> str:
    """Return what a figure of whole files was and is, nothing for rows made without."""
    was, now = row.get(f"{key}_before"), row.get(f"{key}_after")
    return f"{float(was):.0f} → {float(now):.0f}" if was and now else ""


def gains_of(rows: Iterable[dict[str, str]]) -> list[float]:
    return [float(r["less_percent"]) for r in rows]


def time_saved(row: dict[str, str]) -> float:
    return 100 * (1 - float(row["time_after_s"]) / float(row["time_before_s"]))


def medians(rows: list[dict[str, str]]) -> str:
    """Return the table of reductions by setting and planner."""
    lines = []
    for (machine, freedom, planner), mine in sorted_groups(rows):
        gains = gains_of(mine)
        peak = max(int(r["peak_mib"]) for r in mine)
        lines.append([machine, freedom, planner, str(len(gains)), spread(gains),
                      f"{min(gains):.1f}", f"{max(gains):.1f}", str(peak)])  # fmt: skip
    head = ["machine", "freedom", "planner", "runs", "median less % (quartiles)", "least", "most",
            "largest peak MiB"]  # fmt: skip
    return markdown(lines, head)


def sorted_groups(rows: list[dict[str, str]]) -> list[tuple[Any, list[dict[str, str]]]]:
    """Return the rows by machine, freedom and planner, planners from weak to strong."""
    found = grouped(rows, "machine", "freedom", "planner")
    return sorted(
        found.items(), key=lambda g: (g[0][0] != "paper", g[0][1], names(ORDER).index(g[0][2]))
    )


def plot_growth(rows: list[dict[str, str]], path: Path) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(12, 5), layout="constrained")
    for k, ((machine,), mine) in enumerate(grouped(rows, "machine").items()):
        n = [int(r["contours"]) for r in mine]
        seconds = [float(r["read_s"]) + float(r["graph_s"]) for r in mine]
        axes[0].loglog(n, seconds, "o", color=f"C{k}", label=machine)
        axes[1].semilogx(n, [int(r["peak_mib"]) for r in mine], "o", color=f"C{k}", label=machine)
    low, high = axes[0].get_xlim()
    axes[0].loglog(
        [low, high], [low / 1000, high / 1000], "--", color="grey", label="1 ms a contour"
    )
    axes[0].set(xlabel="contours", ylabel="seconds, reading and graph")
    axes[1].set(xlabel="contours", ylabel="peak memory, MiB", ylim=(0, None))
    for axis in axes:
        axis.grid(alpha=0.3)
        axis.legend()
    figure.savefig(path, dpi=110)


def plot_reductions(rows: list[dict[str, str]], path: Path) -> None:
    """Draw the paper's box plot: the slicer's order is the line at zero."""
    import matplotlib.pyplot as plt

    groups = sorted_groups(rows)
    figure, axis = plt.subplots(figsize=(max(6, 1.4 * len(groups)), 5), layout="constrained")
    axis.axhline(0.0, color="grey", label="the slicer's order")
    axis.boxplot(
        [gains_of(mine) for _, mine in groups],
        tick_labels=[
            f"{planner}\n{machine}\n{freedom}" for (machine, freedom, planner), _ in groups
        ],
        widths=0.5,
    )
    axis.set(ylabel="travel less than in the slicer's order, %", ylim=(-5, 100))
    axis.grid(axis="y", alpha=0.3)
    axis.legend()
    figure.savefig(path, dpi=110)


def write_results(rows: Rows, options: argparse.Namespace) -> None:
    done = [r for r in rows.rows if not r["error"] and float(r["limit_s"]) == options.time_limit]
    done = [r for r in done if r["process"] == options.process]
    done.sort(key=lambda r: (int(r["contours"] or 0), r["model"], r["machine"], r["freedom"]))
    said = setting(
        note=options.note, quality="none", process_order=options.process,
        time_limit=f"{options.time_limit:g} s", seeds=" ".join(sorted({r["seed"] for r in done})),
        seconds=CPU_TIME,
    )  # fmt: skip
    text = f"# All models, one head\n\n{said}\n\nRepeat: `python benchmarks/models.py`. "
    text += "Gains are against PrusaSlicer 2.5.0 with aligned seam.\n\n"
    text += medians(done) + "\n![reductions](reductions.png)\n\n![growth](models.png)\n"
    for (planner,), mine in grouped(done, "planner").items():
        text += f"\n## `{planner}`\n\n" + table(mine)
    text += rows.failures()
    (options.results / "models.md").write_text(text)
    if done:
        plot_growth(done, options.results / "models.png")
        plot_reductions(done, options.results / "reductions.png")


def all_models() -> list[str]:
    """Return the names of the corpus' models, small files first."""
    files = (corpus() / "models" / "gcode").glob("*.gcode.gz")
    ordered = sorted(files, key=lambda path: path.stat().st_size)
    return [path.name.removesuffix(".gcode.gz") for path in ordered]


def main() -> None:
    parser = arguments(__doc__, time_limit=20.0, models="")
    parser.add_argument("--machines", type=names, default=["paper", "mk4s"])
    parser.add_argument("--freedoms", type=names, default=["reversible", "seam"])
    parser.add_argument("--process", default="keep", choices=["keep", "free"])
    parser.add_argument("--planners", type=names, default=["hybrid"])
    parser.add_argument("--jobs", type=int, default=1, help="at a time; hybrid uses two threads")
    options = parser.parse_args()
    rows = Rows(options.results / "models.csv", KEY)
    if not options.table_only:
        keys = [
            dict(zip(KEY, (model, machine, options.process, freedom, planner,
                           options.time_limit, seed), strict=True))
            for seed, model, planner, machine, freedom in itertools.product(
                options.seeds, options.models or all_models(), options.planners,
                options.machines, options.freedoms,
            )
        ]  # fmt: skip
        for group in in_groups(keys, options.jobs):
            run_missing(rows, group, run_key, jobs=options.jobs)
    write_results(rows, options)


if __name__ == "__main__":
    main()
