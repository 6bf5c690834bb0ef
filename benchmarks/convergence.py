"""Travel over time and over iterations, every planner, on three prints like the paper's.

    python benchmarks/convergence.py [--time-limit 60] [--models four_nuts]

Four nuts are this project's own; an organic model of two twisting arms stands in
for `twisty`, a chair of slats, with many highly dependent subgraphs, for `sponge
holder`. The paper's setting: machine `paper`, entries fixed, geometry edges only.
Writes docs/results/convergence.csv (a row a run, resumable), convergence_history.csv,
convergence.md and convergence.png.

References
----------
Yoo et al. 2020, the figure of convergence for `four nuts`, `twisty`, `sponge holder`.
"""

from __future__ import annotations

import argparse
import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
from common import (
    Rows,
    arguments,
    grouped,
    markdown,
    median,
    names,
    run_missing,
    setting,
    spread,
)
from in_process import less_percent, searched
from numpy.typing import NDArray

LIKE = {"four_nuts": "four nuts", "distorted_v": "twisty", "lutyens_chair": "sponge holder"}
PLANNERS = "layerwise greedy mcts local hybrid"
KEY = ("model", "machine", "process", "freedom", "planner", "limit_s", "seed")
POINT = (*KEY, "seconds", "iterations", "travel_mm")
MOST_POINTS = 100  # of a curve in the file, evenly by the logarithm of the time
SHARES = (0.5, 0.9, 0.99)  # of the final gain


def run(key: dict[str, Any], points: Rows) -> dict[str, Any]:
    where = [key[name] for name in ("model", "machine", "process", "freedom", "planner")]
    prepared, result = searched(*where, limit_s=key["limit_s"], seed=key["seed"])
    for seconds, iterations, travel in thinned(result.history):
        found = (round(seconds, 4), int(iterations), round(travel, 3))
        points.append(key | dict(zip(POINT[len(KEY) :], found, strict=True)))
    return key | {
        "contours": len(prepared.job.contours),
        "travel_before_mm": result.source_cost,
        "travel_after_mm": result.cost,
        "less_percent": round(less_percent(result), 2),
        "iterations": result.iterations,
        "improvements": len(result.history) - 1,
        **{f"s_to_{share:g}": round(reached(result.history, share), 3) for share in SHARES},
        "error": "",
    }


def reached(history: NDArray[np.float64], share: float) -> float:
    """Return the seconds after which this share of the final gain was there."""
    travel = history[:, 2]
    return float(history[np.argmax(travel <= travel[0] - share * (travel[0] - travel[-1])), 0])


def thinned(history: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return at most `MOST_POINTS` points of a history, first and last among them."""
    at = np.log10(np.maximum(history[:, 0], 1e-3))
    wanted = np.linspace(at[0], at[-1], MOST_POINTS)
    keep = np.unique(np.searchsorted(at, wanted, side="right") - 1)
    return np.asarray(history[np.union1d([0, len(history) - 1], np.maximum(keep, 0))])


def table(rows: list[dict[str, str]]) -> str:
    """Return a line a print and planner; several seeds as median and quartiles."""
    lines = []
    for (model, planner), mine in grouped(rows, "model", "planner").items():
        gains = [float(r["less_percent"]) for r in mine]
        lines.append(
            [model, LIKE.get(model, ""), mine[0]["contours"], planner]
            + [f"{float(mine[0]['travel_before_mm']):.0f}"]
            + [f"{median(mine, 'travel_after_mm'):.0f}", spread(gains)]
            + [f"{median(mine, f's_to_{share:g}'):.2f}" for share in SHARES]
            + [f"{median(mine, 'iterations'):.3g}"]
        )
    head = ["print", "like", "contours", "planner", "source mm", "found mm", "less %"]
    head += [f"s to {share:.0%} of its gain" for share in SHARES]
    return markdown(lines, [*head, "iterations"])


def plot(points: list[dict[str, str]], limit_s: float, path: Path) -> None:
    import matplotlib.pyplot as plt

    curves = grouped([{**p, "error": ""} for p in points], "model", "planner", "seed")
    models = list(dict.fromkeys(model for model, _, _ in curves))
    figure, axes = plt.subplots(
        len(models), 2, figsize=(12, 3.6 * len(models)), layout="constrained", squeeze=False
    )
    for (model, planner, seed), curve in curves.items():
        row, k = axes[models.index(model)], names(PLANNERS).index(planner)
        travel = [float(p["travel_mm"]) / 1000 for p in curve]
        seconds = [max(float(p["seconds"]), 1e-2) for p in curve]
        iterations = [max(float(p["iterations"]), 1.0) for p in curve]
        label = planner if seed == "0" else None
        row[0].step([*seconds, limit_s], [*travel, travel[-1]], color=f"C{k}", where="post")
        row[1].step(iterations, travel, color=f"C{k}", where="post", label=label)
    for model, row in zip(models, axes, strict=True):
        row[0].set(xlabel="seconds", ylabel="travel, m", title=model)
        row[1].set(xlabel="iterations, each planner's own", title=f"like {LIKE.get(model, model)}")
        row[1].legend()
        for axis in row:
            axis.set_xscale("log")
            axis.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


def write_results(rows: list[dict[str, str]], points: Rows, options: argparse.Namespace) -> None:
    rows = [r for r in rows if math.isclose(float(r["limit_s"]), options.time_limit)]
    said = setting(
        note=options.note, machine="paper", process_order="free", quality="none", freedom="fixed",
        time_limit=f"{options.time_limit:g} s", seeds=" ".join(sorted({r["seed"] for r in rows})),
    )  # fmt: skip
    text = f"# Convergence\n\n{said}\n\nRepeat: `python benchmarks/convergence.py"
    text += f" --time-limit {options.time_limit:g}`. An iteration "
    text += "is the planner's own: a sequence, a rollout, or a move tried. Reading, graph and "
    text += "compiling are off the clock.\n\n![convergence](convergence.png)\n\n" + table(rows)
    (options.results / "convergence.md").write_text(text)
    points.read()
    mine = [p for p in points.rows if math.isclose(float(p["limit_s"]), options.time_limit)]
    if mine:
        plot(mine, options.time_limit, options.results / "convergence.png")


def main() -> None:
    parser = arguments(__doc__, time_limit=60.0, models=" ".join(LIKE))
    parser.add_argument("--planners", type=names, default=names(PLANNERS))
    options = parser.parse_args()
    rows = Rows(options.results / "convergence.csv", KEY)
    points = Rows(options.results / "convergence_history.csv", POINT)
    keys = [
        dict(zip(KEY, (model, "paper", "free", "fixed", planner, options.time_limit, seed),
                 strict=True))
        for model, seed, planner in itertools.product(
            options.models, options.seeds, options.planners
        )
    ]  # fmt: skip
    if not options.table_only:
        run_missing(rows, keys, lambda key: run(key, points))
    write_results(rows.rows, points, options)


if __name__ == "__main__":
    main()
