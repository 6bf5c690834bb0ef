"""All 63 models, one head: contours, edges, seconds, memory and what was gained.

    python benchmarks/models.py [--time-limit 10] [--machines paper,mk4s] [--models a,b]

Writes docs/results/models.csv (a row a run, resumable), models.md and models.png.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
from pathlib import Path
from typing import Any

from common import RESULTS, Rows, corpus, markdown, measured, setting

STEPS = ("read", "graph", "plan", "verify", "write")
KEY = ("model", "machine", "process", "freedom", "planner", "limit_s", "seed")


def run(path: Path, key: dict[str, Any]) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        arguments = ["plan", str(path), "-o", f"{folder}/out.gcode", "--machine", key["machine"]]
        arguments += ["--planner", key["planner"], "--time-limit", str(key["limit_s"])]
        arguments += ["--freedom", key["freedom"], "--process-order", key["process"]]
        arguments += ["--no-quality"]  # `free` is geometry only; what quality costs: quality.py
        result = measured([*arguments, "--seed", str(key["seed"])])
    return {**key, **figures_of(result)}


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
        "verified": result.get("verified", False),
        "error": result.get("error", ""),
    }


def table(rows: list[dict[str, str]]) -> str:
    head = ["model", "machine", "contours", "edges", "read s", "graph s", "plan s", "verify s",
            "write s", "peak MiB", "travel before mm", "after mm", "less %", "emitted less %",
            "time less %", "verified"]  # fmt: skip
    lines = []
    for r in rows:
        if r["error"]:
            lines.append([r["model"], r["machine"], *[""] * 13, r["error"]])
            continue
        emitted = 100 * (1 - float(r["emitted_after_mm"]) / float(r["emitted_before_mm"]))
        timed = 100 * (1 - float(r["time_after_s"]) / float(r["time_before_s"]))
        lines.append(
            [r["model"], r["machine"], r["contours"], r["edges"]]
            + [f"{float(r[f'{s}_s']):.2f}" for s in STEPS]
            + [r["peak_mib"], f"{float(r['travel_before_mm']):.0f}"]
            + [f"{float(r['travel_after_mm']):.0f}", f"{float(r['less_percent']):.1f}"]
            + [f"{emitted:.1f}", f"{timed:.1f}", "yes" if r["verified"] == "True" else "NO"]
        )
    return markdown(lines, head)


def medians(rows: list[dict[str, str]], machines: list[str]) -> str:
    text = ""
    for machine in machines:
        gains = [
            float(r["less_percent"]) for r in rows if r["machine"] == machine and not r["error"]
        ]
        if len(gains) > 1:
            low, mid, high = statistics.quantiles(gains, n=4)
            text += (
                f"- `{machine}`: {len(gains)} models, median reduction {mid:.1f} % "
                f"(quartiles {low:.1f} and {high:.1f}, least {min(gains):.1f}, "
                f"most {max(gains):.1f})\n"
            )
    return text


def plot(rows: list[dict[str, str]], path: Path) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(12, 5), layout="constrained")
    for machine, colour in (("paper", "tab:blue"), ("mk4s", "tab:orange")):
        mine = [r for r in rows if r["machine"] == machine and not r["error"]]
        n = [int(r["contours"]) for r in mine]
        seconds = [float(r["read_s"]) + float(r["graph_s"]) for r in mine]
        axes[0].loglog(n, seconds, "o", color=colour, label=machine)
        axes[1].semilogx(n, [int(r["peak_mib"]) for r in mine], "o", color=colour, label=machine)
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--time-limit", type=float, default=10.0)
    parser.add_argument("--machines", default="paper,mk4s")
    parser.add_argument("--models", default="")
    parser.add_argument("--table-only", action="store_true")
    parser.add_argument("--note", default="", help="said beside the setting")
    options = parser.parse_args()
    machines = options.machines.split(",")
    rows = Rows(RESULTS / "models.csv", KEY)
    wanted = set(filter(None, options.models.split(",")))
    files = sorted(
        (corpus() / "models" / "gcode").glob("*.gcode.gz"), key=lambda p: p.stat().st_size
    )
    for path in [] if options.table_only else files:
        name = path.name.removesuffix(".gcode.gz")
        if wanted and name not in wanted:
            continue
        for machine in machines:
            key = dict(zip(KEY, (name, machine, "keep", "reversible", "local",
                                 options.time_limit, 0), strict=True))  # fmt: skip
            if not rows.has(**key):
                rows.append(run(path, key))
                print(*(f"{k}={v}" for k, v in rows.rows[-1].items()), flush=True)
    done = sorted(rows.rows, key=lambda r: (int(r["contours"] or 0), r["machine"]))
    said = setting(note=options.note, quality="none",
                   planner="local", freedom="reversible", process_order="keep",
                   time_limit=f"{options.time_limit:g} s", seed=0)  # fmt: skip
    text = f"# All models, one head\n\n{said}\n\nRepeat: `python benchmarks/models.py`. "
    text += "Gains are against PrusaSlicer 2.5.0 with aligned seam.\n\n"
    text += medians(done, machines) + "\n![growth](models.png)\n\n" + table(done)
    (RESULTS / "models.md").write_text(text)
    plot(done, RESULTS / "models.png")


if __name__ == "__main__":
    main()
