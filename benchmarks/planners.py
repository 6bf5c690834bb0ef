"""Every planner on twelve models at equal time, with the annealing yardstick beside.

    python benchmarks/planners.py [--settings paper-fixed,mk4s-seam] [--process free,keep]
    python benchmarks/planners.py --time-limit 10
    python benchmarks/planners.py --time-limits 10,60,600 --settings paper-reversible --process keep

The last command measures what a longer search still gains. The prints that have a
yardstick and are not of the twelve: `--models odri_spacers_6,six_cylinders,gf_divided_cup
--settings paper-fixed,paper-reversible --process free`. `hybrid` uses two threads and
runs alone; the others use one and may run two at a time (`--jobs 2`).
Runs go a few rows of the table at a time, so that a stopped run leaves whole rows.
Writes docs/results/planners.csv (a row a run, resumable), planners.md and a picture
for each time limit.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from common import (
    CPU_TIME,
    Rows,
    arguments,
    grouped,
    in_groups,
    markdown,
    median,
    names,
    print_path,
    run_missing,
    setting,
    spread,
)
from models import KEY, run

MODELS = (
    "stained_glass_3 xyz_cube_20 openbot_phone_mount pillars_5x5 teaset_chess_7 spool_mount_4 "
    "benchy_lowpoly odri_pulleys_rollers_9 tardis_drawer_4div quad_lower_leg_plate "
    "playblock_chess_16 pencil_tubes_64"
)
YARDSTICK = {  # model: (fixed, reversible) less travel by plain annealing, per cent
    "stained_glass_3": (12, 33),
    "openbot_phone_mount": (20, 66),
    "pillars_5x5": (52, 58),
    "odri_spacers_6": (56, 59),
    "six_cylinders": (37, 48),
    "teaset_chess_7": (71, 73),
    "benchy_lowpoly": (48, 65),
    "spool_mount_4": (57, 77),
    "odri_pulleys_rollers_9": (61, 63),
    "gf_divided_cup": (60, 65),
    "tardis_drawer_4div": (62, 67),
}
SETTINGS = "paper-fixed paper-reversible paper-seam mk4s-reversible mk4s-seam"
PLANNERS = "hybrid local mcts greedy layerwise"
ROW = ("process", "machine", "freedom", "model")
TIE = 1e-9  # of the travel


def batches(options: argparse.Namespace, limit_s: float) -> Iterator[tuple[int, list[Any]]]:
    """Yield how many may run at a time, and the keys of runs; whole rows of the table in turn."""
    rows = list(itertools.product(options.seeds, options.process, options.settings, options.models))
    alone = [name for name in options.planners if name == "hybrid"]
    others = [name for name in options.planners if name != "hybrid"]
    for group in in_groups(rows, options.jobs):
        for jobs, planners in ((1, alone), (options.jobs, others)):
            of_row = itertools.product(planners, group)
            yield jobs, [key_of(*row, planner=planner, limit_s=limit_s) for planner, row in of_row]


def key_of(
    seed: int, process: str, name: str, model: str, *, planner: str, limit_s: float
) -> dict[str, Any]:
    machine, freedom = name.split("-")
    return dict(zip(KEY, (model, machine, process, freedom, planner, limit_s, seed), strict=True))


def run_key(key: dict[str, Any]) -> dict[str, Any]:
    return run(print_path(key["model"]), key, write=False)


def comparison(rows: list[dict[str, str]], planners: list[str]) -> str:
    """Return the table of reductions, a line a model and setting, and what it comes to."""
    lines, verdicts, margins = [], [], []
    for row, mine in grouped(rows, *ROW).items():
        found = {key[0]: runs for key, runs in grouped(mine, "planner").items()}
        verdict, margin = judged(row, found, planners)
        verdicts.append(verdict)
        margins += [] if margin is None else [margin]
        cells = [spread([float(r["less_percent"]) for r in found.get(p, [])], 2) for p in planners]
        annealing = yardstick_of(row)
        lines.append([row[3], f"{row[1]} {row[2]}", row[0],
                      "" if annealing is None else str(annealing), *cells, verdict])  # fmt: skip
    head = ["model", "setting", "process", "annealing", *planners, "hybrid ≥ all"]
    judged_rows = [verdict for verdict in verdicts if verdict]
    worse = [verdict for verdict in judged_rows if verdict != "yes"]
    text = f"`hybrid` is no worse than all others in {len(judged_rows) - len(worse)} of "
    text += f"{len(judged_rows)} complete rows"
    if margins:
        text += "; its travel is below the best other planner's by "
        text += f"{spread(margins, 2)} %, {min(margins):.2f} % at the least"
    return f"{text}.\n\n{annealing_reached(rows, planners)}" + markdown(lines, head)


def judged(
    row: tuple[str, ...], found: dict[str, list[dict[str, str]]], planners: list[str]
) -> tuple[str, float | None]:
    """Return the verdict on `hybrid` ("" if the row is incomplete), and its margin in per cent."""
    others = [name for name in planners if name != "hybrid"]
    if not others or any(name not in found for name in planners) or "hybrid" not in planners:
        return "", None
    travel = {name: median(runs, "travel_after_mm") for name, runs in found.items()}
    best = min(others, key=lambda name: travel[name])
    margin = 100 * (1 - travel["hybrid"] / travel[best]) if travel[best] else 0.0
    if travel["hybrid"] > travel[best] * (1 + TIE):
        return f"NO: {best} by {-margin:.2f} %", margin
    if reaches_yardstick(row, found["hybrid"]) is False:
        return "NO: annealing", margin
    return "yes", margin


def reaches_yardstick(row: tuple[str, ...], runs: list[dict[str, str]]) -> bool | None:
    """Tell whether one planner's runs come to the annealing figure, None if there is none."""
    target = yardstick_of(row)
    return None if target is None else round(median(runs, "less_percent")) >= target


def annealing_reached(rows: list[dict[str, str]], planners: list[str]) -> str:
    """Return a sentence on how many annealing figures each planner comes to."""
    counts = []
    for planner in planners:
        mine = grouped((r for r in rows if r["planner"] == planner), *ROW)
        told = [reaches_yardstick(row, runs) for row, runs in mine.items()]
        known = [reached for reached in told if reached is not None]
        counts += [f"`{planner}` in {sum(known)} of {len(known)}"] if known else []
    return f"Annealing's figure is reached by {', '.join(counts)} rows.\n\n" if counts else ""


def yardstick_of(row: tuple[str, ...]) -> int | None:
    """Return the annealing figure for a row; it is known for `paper`, geometry only."""
    process, machine, freedom, model = row
    if (process, machine) != ("free", "paper") or freedom not in ("fixed", "reversible"):
        return None
    return YARDSTICK[model][freedom == "reversible"] if model in YARDSTICK else None


def complete(rows: list[dict[str, str]], planners: list[str]) -> list[dict[str, str]]:
    """Return the runs of models that all planners have run, so that like is compared with like."""
    there = grouped(rows, *ROW)
    return [
        r for mine in there.values() if {r["planner"] for r in mine} >= {*planners} for r in mine
    ]


def by_model(rows: list[dict[str, str]]) -> list[float]:
    """Return each model's reduction, of several seeds the median, so that none counts twice."""
    return [median(runs, "less_percent") for runs in grouped(rows, "model").values()]


def medians(rows: list[dict[str, str]], planners: list[str]) -> str:
    """Return the table of median reductions and quartiles, a line a setting."""
    lines = []
    for (process, machine, freedom), mine in grouped(rows, *ROW[:3]).items():
        found = grouped(mine, "planner")
        cells = [spread(by_model(found.get((p,), []))) for p in planners]
        models = len({r["model"] for r in mine})
        lines.append([f"{machine} {freedom}", process, str(models), *cells])
    return markdown(lines, ["setting", "process", "models", *planners])


def longer(rows: list[dict[str, str]]) -> str:
    """Return the table of what `hybrid` gains with more time, for rows with the longest limit."""
    mine = [r for r in rows if r["planner"] == "hybrid"]
    by_row = {row: grouped(runs, "limit_s") for row, runs in grouped(mine, *ROW).items()}
    limits = sorted({float(key[0]) for found in by_row.values() for key in found})
    if len(limits) < 2:
        return ""
    by_row = {row: found for row, found in by_row.items() if (str(limits[-1]),) in found}
    lines: list[list[str]] = []
    above: dict[float, list[float]] = {limit: [] for limit in limits}
    for row, found in by_row.items():
        travel = {
            limit: median(found[str(limit),], "travel_after_mm")
            for limit in limits
            if (str(limit),) in found
        }
        cells = [f"{travel[limit]:.1f}" if limit in travel else "" for limit in limits]
        for limit in limits[:-1]:
            if limit in travel:
                above[limit].append(100 * (travel[limit] / travel[limits[-1]] - 1))
            cells.append(f"{above[limit][-1]:+.2f}" if limit in travel else "")
        lines.append([row[3], f"{row[1]} {row[2]}", row[0], *cells])
    head = ["model", "setting", "process", *(f"{limit:g} s, mm" for limit in limits)]
    head += [f"{limit:g} s over {limits[-1]:g} s, %" for limit in limits[:-1]]
    text = "\n## What a longer search still gains\n\n"
    for limit in limits[:-1]:
        if above[limit]:
            text += f"- `hybrid` at {limit:g} s travels {spread(above[limit], 2)} % more than at "
            text += f"{limits[-1]:g} s, {max(above[limit]):.2f} % at the most "
            text += f"({len(above[limit])} rows)\n"
    return text + "\n" + markdown(lines, head)


def plot(rows: list[dict[str, str]], planners: list[str], path: Path) -> None:
    import matplotlib.pyplot as plt

    by_setting = grouped(rows, *ROW[:3])
    figure, axis = plt.subplots(figsize=(13, 5), layout="constrained")
    for k, planner in enumerate(planners):
        values = [
            by_model([r for r in mine if r["planner"] == planner]) for mine in by_setting.values()
        ]
        places = [x + 0.15 * (k - len(planners) / 2 + 0.5) for x in range(len(values))]
        axis.boxplot(
            values, positions=places, widths=0.12, patch_artist=True, manage_ticks=False,
            boxprops={"facecolor": f"C{k}", "alpha": 0.6}, medianprops={"color": "black"},
        )  # fmt: skip
        axis.plot([], [], "s", color=f"C{k}", label=planner)
    labels = [f"{machine} {freedom}\n{process}" for process, machine, freedom in by_setting]
    axis.set_xticks(range(len(labels)), labels)
    axis.set(ylabel="travel less than in the source, %")
    axis.grid(axis="y", alpha=0.3)
    axis.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=5, frameon=False)
    figure.savefig(path, dpi=110)


def place(row: dict[str, str]) -> tuple[Any, ...]:
    """Return where a row stands in the tables."""
    named = ((f"{row['machine']}-{row['freedom']}", SETTINGS), (row["model"], MODELS))
    places = [names(all_).index(one) if one in names(all_) else 99 for one, all_ in named]
    return (row["process"], *places, row["machine"], row["freedom"], row["model"])


def write_results(rows: Rows, options: argparse.Namespace) -> None:
    done = sorted((r for r in rows.rows if not r["error"]), key=place)
    said = setting(
        note=options.note, quality="none", seeds=" ".join(sorted({r["seed"] for r in done})),
        seconds=CPU_TIME,
    )  # fmt: skip
    text = f"# Planners at equal time\n\n{said}\n\nRepeat: `python benchmarks/planners.py`, "
    text += (
        "for single rows with `--time-limit`, `--models`, `--settings`, `--process`, `--seeds`. "
    )
    text += "Reduction of extrusionless travel against the source's order (PrusaSlicer 2.5.0, "
    text += "aligned seam), in per cent; of several seeds, or models, the median and in brackets "
    text += "the quartiles. Annealing: the yardstick, plain simulated annealing on linear "
    text += "extensions with edges of geometry only, whole per cent. Each plan was verified.\n"
    by_limit = grouped(done, "limit_s")
    for limit in sorted((limit for (limit,) in by_limit), key=float, reverse=True):
        mine = by_limit[limit,]
        planners = [name for name in names(PLANNERS) if name in {r["planner"] for r in mine}]
        if len(planners) < 2:  # only what a longer search gains
            continue
        picture = f"planners_{float(limit):g}s.png"
        whole = complete(mine, planners)
        plot(whole, planners, options.results / picture)
        text += f"\n## {float(limit):g} s\n\n{medians(whole, planners)}\n"
        text += f"![reductions]({picture})\n\n{comparison(mine, planners)}"
    text += longer(done) + rows.failures()
    (options.results / "planners.md").write_text(text)


def main() -> None:
    parser = arguments(__doc__, time_limit=60.0, models=MODELS)
    parser.add_argument("--settings", type=names, default=names(SETTINGS))
    parser.add_argument("--process", type=names, default=["free", "keep"])
    parser.add_argument("--planners", type=names, help="default: all, or hybrid if --time-limits")
    parser.add_argument("--time-limits", type=names, default=[], help="several, seconds")
    parser.add_argument("--jobs", type=int, default=1, help="runs on one thread at a time")
    options = parser.parse_args()
    options.planners = options.planners or names("hybrid" if options.time_limits else PLANNERS)
    rows = Rows(options.results / "planners.csv", KEY)
    for limit_s in map(float, options.time_limits or [options.time_limit]):
        for jobs, keys in batches(options, limit_s):
            if not options.table_only:
                run_missing(rows, keys, run_key, jobs=jobs)
    write_results(rows, options)


if __name__ == "__main__":
    main()
