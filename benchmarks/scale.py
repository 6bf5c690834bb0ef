"""How time, memory and iterations per second grow with the print, up to 44 000 contours.

    python benchmarks/scale.py [--time-limit 60] [--stop-at 15] [--models a,b]

Each print is planned twice in a process of its own. The first search is stopped
after `--stop-at` seconds, as Ctrl-C would, and its result verified: that tells
when a first improved verified result can be there, counted from the end of the
graph, and which share of the final gain it has. The second uses its time limit.
Writes docs/results/scale.csv (a row a run, resumable), scale.md and scale.png.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from common import (
    Rows,
    arguments,
    grouped,
    markdown,
    names,
    of_models,
    own_process,
    run_missing,
    setting,
)

MODELS = (
    "heart_flat gf_chess_tile xyz_cube_20 torus_5cm pillars_5x5 teaset_chess_7 mozc_holders_6 "
    "tardis_drawer_4div hand_finger_frames_8 strong_brackets_8 branches_16 "
    "extending_tube_6 so100_plate_part1 pencil_tubes_64 dodeca_chain_40 link_cup spiral_cup"
)
KEY = ("model", "machine", "process", "freedom", "planner", "limit_s", "seed")
LARGE = 17_000  # contours from which the first result is asked for
WITHIN_S, SHARE, MEMORY_MIB = 30.0, 30.0, 4096  # what is asked of large prints


def run(key: dict[str, Any], stop_at_s: float) -> dict[str, Any]:
    asked = json.dumps({**key, "stop_at_s": stop_at_s})
    result = own_process([sys.executable, __file__, "--worker", asked])
    found = {name: result.get(name, "") for name in FIGURES}
    return {**key, **found, "peak_mib": round(result["peak_mib"]), "error": result.get("error", "")}


FIGURES = (
    "contours", "edges", "read_s", "graph_s", "iterations", "iterations_per_s", "improved_s",
    "first_verified_s", "first_less_percent", "less_percent", "share_percent", "check_s",
)  # fmt: skip


def work(asked: dict[str, Any]) -> dict[str, Any]:
    """Plan one print twice, in this process; see `FIGURES`."""
    from in_process import freed, loaded, named

    from decmcts.planning.one_head.pipeline import plan_judged
    from decmcts.planning.options import Search

    prepared = loaded(asked["model"], asked["machine"], asked["process"])
    prepared = freed(prepared, asked["freedom"])
    planner = named(asked["planner"])
    search = Search(asked["limit_s"], asked["seed"], planner, certificate=False)
    began = time.perf_counter()
    first = plan_judged(
        prepared, search, stop=lambda: time.perf_counter() - began >= asked["stop_at_s"]
    )
    first_s = time.perf_counter() - began
    final = plan_judged(prepared, search)
    history, iterations = final.history, int(final.after.metrics["iterations"])
    early, late = less_percent(first.history), less_percent(history)
    return {
        "contours": len(prepared.job.contours),
        "edges": prepared.graph.n_edges,
        "read_s": round(prepared.seconds["read"], 3),
        "graph_s": round(prepared.seconds["graph"], 3),
        "iterations": iterations,
        "iterations_per_s": round(iterations / min(asked["limit_s"], final.seconds["plan"]), 1),
        "improved_s": round(float(history[min(1, len(history) - 1), 0]), 3),
        "first_verified_s": round(first_s, 2),
        "first_less_percent": round(early, 2),
        "less_percent": round(late, 2),
        "share_percent": round(100 * early / late, 1) if late else 100.0,
        "check_s": round(final.seconds["verify"], 2),
    }


def less_percent(history: Any) -> float:
    """Return the reduction at the end of a history, in per cent."""
    return 100 * (1 - history[-1, 2] / history[0, 2]) if history[0, 2] else 0.0


def table(rows: list[dict[str, str]]) -> str:
    lines = [
        [r["model"], r["planner"], r["contours"], r["edges"]]
        + [f"{float(r[name]):.2f}" for name in ("read_s", "graph_s")]
        + [r["peak_mib"], f"{float(r['iterations_per_s']):.3g}", r["improved_s"]]
        + [r["first_verified_s"], r["first_less_percent"], r["less_percent"], r["share_percent"]]
        for r in rows
    ]
    head = ["model", "planner", "contours", "edges", "read s", "graph s", "peak MiB",
            "iterations/s", "first improved s", "first verified s", "its less %", "final less %",
            "share of final gain %"]  # fmt: skip
    return markdown(lines, head)


def verdict(rows: list[dict[str, str]]) -> str:
    """Return what is asked of large prints and whether it holds."""
    large = [r for r in rows if int(r["contours"]) > LARGE and r["planner"] == "hybrid"]
    text = ""
    if large:
        latest = max(float(r["first_verified_s"]) for r in large)
        share = min(float(r["share_percent"]) for r in large)
        peak = max(int(r["peak_mib"]) for r in large)
        improved = all(float(r["first_less_percent"]) > 0 for r in large)
        held = improved and latest <= WITHIN_S and share >= SHARE and peak <= MEMORY_MIB
        text += f"- {len(large)} prints with more than {LARGE} contours: first improved verified "
        text += f"result after {latest:.1f} s at the latest (wanted {WITHIN_S:g}), with "
        text += f"{share:.0f} % of the final gain at the least (wanted {SHARE:g}), "
        text += f"{peak} MiB at the most (wanted {MEMORY_MIB}): {'yes' if held else 'NO'}\n"
    for (planner,), mine in grouped(rows, "planner").items():
        if len(mine) > 2:
            text += f"- `{planner}`: iterations per second fall as (n log n)^{slope(mine):.2f} "
            text += "(wanted: no steeper than -1)\n"
    return text


def slope(rows: list[dict[str, str]]) -> float:
    """Return the exponent of n log n in the iterations per second, by least squares."""
    n = np.array([float(r["contours"]) for r in rows])
    rate = np.array([float(r["iterations_per_s"]) for r in rows])
    return float(np.polyfit(np.log(n * np.log(n)), np.log(rate), 1)[0])


def plot(rows: list[dict[str, str]], path: Path) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(15, 4.6), layout="constrained")
    for k, ((planner,), mine) in enumerate(grouped(rows, "planner").items()):
        mine.sort(key=lambda r: int(r["contours"]))
        n = np.array([float(r["contours"]) for r in mine])
        seconds = [float(r["read_s"]) + float(r["graph_s"]) for r in mine]
        rate = np.array([float(r["iterations_per_s"]) for r in mine])
        axes[0].loglog(n, seconds, "o", color=f"C{k}", label=planner)
        axes[1].semilogx(n, [int(r["peak_mib"]) for r in mine], "o", color=f"C{k}", label=planner)
        axes[2].loglog(n, rate, "o", color=f"C{k}", label=planner)
        if len(mine) > 1:  # of one print there is no growth to compare with
            growth = n * np.log(n)
            axes[0].loglog(n, seconds[0] * growth / growth[0], "--", color=f"C{k}", alpha=0.4)
            axes[2].loglog(n, rate[0] * growth[0] / growth, "--", color=f"C{k}", alpha=0.4)
    axes[0].set(ylabel="seconds, reading and graph; dashed: n log n")
    axes[1].set(ylabel="peak memory, MiB", ylim=(0, None))
    axes[2].set(ylabel="iterations per second; dashed: 1 / (n log n)")
    for axis in axes:
        axis.set_xlabel("contours")
        axis.grid(alpha=0.3)
        axis.legend()
    figure.savefig(path, dpi=110)


def write_results(rows: Rows, options: argparse.Namespace) -> None:
    mine = [r for r in rows.rows if not r["error"] and float(r["limit_s"]) == options.time_limit]
    mine.sort(key=lambda r: int(r["contours"]))
    said = setting(
        note=options.note, machine=options.machine, process_order="keep", quality="none",
        freedom="reversible", time_limit=f"{options.time_limit:g} s",
        seeds=" ".join(sorted({r["seed"] for r in mine})),
    )  # fmt: skip
    text = f"# Scale\n\n{said}\n\nRepeat: `python benchmarks/scale.py"
    text += f" --time-limit {options.time_limit:g}{of_models(mine, MODELS)}`. "
    text += "First verified: the search "
    text += f"stopped after {options.stop_at:g} s of planning, its plan made and verified.\n\n"
    text += verdict(mine) + "\n![scale](scale.png)\n\n" + table(mine) + rows.failures()
    (options.results / "scale.md").write_text(text)
    if mine:
        plot(mine, options.results / "scale.png")


def main() -> None:
    parser = arguments(__doc__, time_limit=60.0, models=MODELS)
    parser.add_argument("--planners", type=names, default=["hybrid"])
    parser.add_argument("--machine", default="paper")
    parser.add_argument("--stop-at", type=float, default=15.0, help="seconds of planning")
    parser.add_argument("--worker", type=json.loads, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        print(json.dumps(work(options.worker)))
        return
    rows = Rows(options.results / "scale.csv", KEY)
    keys = [
        dict(zip(KEY, (model, options.machine, "keep", "reversible", planner, options.time_limit,
                       seed), strict=True))
        for seed, planner, model in itertools.product(
            options.seeds, options.planners, options.models
        )
    ]  # fmt: skip
    if not options.table_only:
        run_missing(rows, keys, lambda key: run(key, options.stop_at))
    write_results(rows, options)


if __name__ == "__main__":
    main()
