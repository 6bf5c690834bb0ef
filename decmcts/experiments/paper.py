"""`paper`: Monte Carlo tree search as published, and with rollouts that are worth something.

The setting is the paper's: its box for a head, edges of geometry only, contours in the direction
in which they were sliced. *Rollouts* are those of the tree search without its tree, all from the
empty print.

References
----------
Yoo et al. 2020, Sec. IV: MCTS and local search against the slicer, as a box plot, and convergence.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from decmcts.experiments.kinds import (
    Asked,
    Experiment,
    Key,
    Line,
    Row,
    Sizes,
    boxes,
    column,
    figure,
    grouped,
    markdown,
    spread,
    stopping_of,
)
from decmcts.experiments.prints import print_file, shown
from decmcts.feasibility.clustering import cluster_contours
from decmcts.planning.options import Freedom, Objective, ProcessOrder, Rules
from decmcts.planning.problem.print_problem import load
from decmcts.search.baselines.mcts import Mcts
from decmcts.search.planners import PLANNERS, plan_order
from decmcts.search.sequence.planner import Planner

if TYPE_CHECKING:
    from matplotlib.figure import Figure

USUAL = 1.4142  # the square root of 2
AS_PUBLISHED = (USUAL, 0.5, 0.0)  # exploration, Γ, chance of the nearest cluster
MOSTLY = 0.995  # such a chance: rollouts are greedy but for one step in two hundred
METHODS: dict[str, tuple[float, float, float] | None] = {  # None: no parameters
    "slicer": None,
    "greedy": None,
    "local": None,
    "mcts": AS_PUBLISHED,
    "mcts, Γ 1": (USUAL, 1.0, 0.0),
    "mcts, Γ 1, nearest": (USUAL, 1.0, MOSTLY),
    "mcts, Γ 1, nearest, exploits": (0.001, 1.0, MOSTLY),
    "rollouts, Γ 1, nearest": (USUAL, 1.0, MOSTLY),
}
COMPARED = [name for name in METHODS if name != "slicer"]
EXPLORATIONS = USUAL, 0.01, 0.0001
THRESHOLDS, CHANCES = (0.5, 1.0), (0.0, 0.95, 0.995)
STEPS = 10_000  # iterations of a search for each that is asked for
MADE = ("four_nuts", "grid-3-12-12", "row-6-14-4", "strewn-9-10-1", "strewn-16-8-2")
RULES = Rules(process_order=ProcessOrder.FREE, quality=False, freedom=Freedom.FIXED)
CURVE = 60  # points of a curve that are kept


def _runs(asked: Asked) -> Iterator[tuple[Any, ...]]:
    prints = asked.prints or MADE
    for name in prints:
        for method in METHODS:
            yield name, method, *(METHODS[method] or ("", "", ""))
    for name in prints if asked.full else prints[:1]:
        for parameters in product(EXPLORATIONS, THRESHOLDS, CHANCES):
            yield name, "parameters", *parameters


def planner_of(key: Key) -> Planner:
    """Return the planner of a run."""
    if METHODS.get(key["method"], AS_PUBLISHED) is None:
        return PLANNERS[key["method"]]
    return Mcts(
        exploration=float(key["exploration"]),
        labels=partial(cluster_contours, threshold=float(key["gamma"])),
        nearest=float(key["nearest"]),
        **({"most_nodes": 1} if key["method"].startswith("rollouts") else {}),
    )


def _run(key: Key) -> Row:
    with print_file(key) as path:
        problem = load(path, "paper", RULES).for_one_head(Objective.TRAVEL)
    planner, seed = planner_of(key), int(key["seed"])
    plan_order(problem, planner=planner, stopping=stopping_of({**key, "iterations": 1}), seed=seed)
    found = plan_order(
        problem, planner=planner, stopping=stopping_of(key, STEPS), seed=seed,
        clock=time.process_time,
    )  # fmt: skip
    clusters = cluster_contours(problem.graph, threshold=float(key["gamma"] or 0.5))
    least = found.cost / found.source_cost if found.source_cost else 1.0  # 0: one contour
    history = found.history[np.linspace(0, len(found.history) - 1, CURVE).round().astype(int)]
    return {
        "contours": len(problem),
        "clusters": int(clusters.max(initial=-1)) + 1,
        "sliced_mm": round(found.source_cost, 1),
        "travel_mm": round(found.cost, 1),
        "less_percent": round(100.0 * (1.0 - least), 2),
        "tried": found.iterations,
        "improved_s": round(float(found.history[-1, 0]), 3),
        "curve": _curve(history, timed=not key["iterations"]),
    }


def _curve(history: Any, *, timed: bool) -> str:
    """Return seconds or iterations, and mm, of each improvement."""
    points = history[:, [0 if timed else 1, 2]].round(4).tolist()
    return json.dumps(list(dict.fromkeys(map(tuple, points))))


def _tables(rows: Sequence[Line]) -> str:
    main = [row for row in rows if row["method"] != "parameters"]
    by_print = grouped(main, "print", "method")
    names = list(dict.fromkeys(row["print"] for row in main))
    lines = [
        [shown(name), by_print[name, "slicer"][0]["contours"],
         by_print[name, "slicer"][0]["clusters"], by_print[name, "slicer"][0]["sliced_mm"],
         *(spread(column(by_print.get((name, m), []), "travel_mm"), 0) for m in COMPARED)]
        for name in names if (name, "slicer") in by_print
    ]  # fmt: skip
    text = "Extrusionless travel, mm.\n\n"
    text += markdown(lines, ["print", "contours", "clusters", "as sliced", *COMPARED])
    text += "\nLess than as sliced, %, over all prints and seeds.\n\n"
    of_method = grouped(main, "method")
    lines = [
        [method, spread(column(of_method[method,], "less_percent")),
         spread(column(of_method[method,], "tried"), 0),
         spread(column(of_method[method,], "improved_s"), 2)]
        for method in COMPARED if (method,) in of_method
    ]  # fmt: skip
    text += markdown(lines, ["method", "less travel %", "sequences tried", "last improved at s"])
    tuned = [row for row in rows if row["method"] == "parameters"]
    text += "\nParameters of the tree search: less travel than as sliced, %.\n\n"
    lines = [
        [nearest, threshold, *(
            spread(column([r for r in mine if r["exploration"] == c], "less_percent"))
            for c in _explorations(tuned))]
        for (nearest, threshold), mine in grouped(tuned, "nearest", "gamma").items()
    ]  # fmt: skip
    heads = [f"exploration {c}" for c in _explorations(tuned)]
    return text + markdown(lines, ["chance of the nearest", "Γ", *heads])


def _explorations(rows: Sequence[Line]) -> list[str]:
    return list(dict.fromkeys(row["exploration"] for row in rows))


def _draw(rows: Sequence[Line]) -> Figure:
    made, axes = figure(3, width=5.4, height=4.8)
    main = [row for row in rows if row["method"] != "parameters" and not row["error"]]
    of_method = grouped(main, "method")
    named = [m for m in COMPARED if (m,) in of_method]
    boxes(axes[0], [column(of_method[m,], "less_percent") for m in named], named)
    axes[0].set(ylabel="less travel than as sliced, %")
    first = main[0]["print"] if main else ""
    for row in main:
        if row["print"] == first and row["seed"] == "0" and row["method"] != "slicer":
            at, travel = zip(*json.loads(row["curve"]), strict=True)
            axes[1].step(
                [max(v, 1e-3) for v in at], travel, where="post", label=row["method"],
                linestyle="--" if row["method"] in ("greedy", "local") else "-",
            )  # fmt: skip
    unit = "s of processor time" if main and main[0]["iterations"] == "0" else "sequences tried"
    axes[1].set(xscale="log", xlabel=unit, ylabel=f"travel of {shown(first)}, mm")
    axes[1].legend(fontsize=7)
    tuned = [row for row in rows if row["method"] == "parameters" and not row["error"]]
    for (nearest, threshold), mine in grouped(tuned, "nearest", "gamma").items():
        axes[2].plot(
            column(mine, "exploration"), column(mine, "less_percent"), "o-",
            label=f"nearest {nearest}, Γ {threshold}",
        )  # fmt: skip
    axes[2].set(xscale="log", xlabel="exploration", ylabel="less travel than as sliced, %")
    if tuned:
        axes[2].legend(fontsize=7)
    return made


PAPER = Experiment(
    "paper",
    "Tree search, local search and the slicer as in the paper: what do tree and rollouts bring?",
    ("print", "method", "exploration", "gamma", "nearest"), _runs, _run, _tables, _draw,
    Sizes(1.5, 60.0), Sizes(1, 3), ("local for travel", "greedy for travel", "mcts for travel"),
)  # fmt: skip
